"""The pages say what the program does: examples load, keys and links exist."""

import re
from pathlib import Path

import pytest

from service.robot_file import RobotFile, _known_keys
from service.robots import build_robot, load_robot

DOCS = Path(__file__).parents[2] / "docs"
TWIN = """<robot name="twin"><link name="base"/><link name="column"/><link name="arm"/>
<joint name="turntable" type="revolute"><parent link="base"/><child link="column"/><axis xyz="0 0 1"/></joint>
<joint name="shoulder" type="revolute"><parent link="column"/><child link="arm"/><origin xyz="0 0 0.4"/>
<axis xyz="0 1 0"/></joint></robot>"""


def test_the_worked_example_is_a_robot():
    text = re.search(r"```toml\n(.*?)```", (DOCS / "describe-your-robot.md").read_text(), re.DOTALL).group(1)
    robot = build_robot(text, TWIN, "the worked example").robot
    assert robot.joint_names == ("turntable", "shoulder")
    assert robot.joints[1].drive.has_rotor
    assert robot.joints[1].drive.rotor_inertia is None
    assert robot.joints[1].drive.rotor_carrier == 0
    assert robot.plate.translation_m[2] == -0.05


def test_every_key_of_the_robot_file_is_described():
    text = (DOCS / "describe-your-robot.md").read_text()
    missing = [key for key in _known_keys(RobotFile) if key not in text]
    assert missing == []


@pytest.mark.parametrize("case", ["emps", "bldc_bench", "ur10"])
def test_the_cases_robots_load(case):
    assert load_robot(DOCS / "cases" / case).name == case


@pytest.mark.parametrize("page", sorted(DOCS.rglob("*.md")), ids=lambda page: str(page.relative_to(DOCS)))
def test_links_between_pages_exist(page):
    for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text()):
        assert (page.parent / target).exists(), target


@pytest.mark.parametrize("page", sorted((DOCS / "decisions").glob("*.md")), ids=lambda page: page.stem)
def test_decisions_name_tests_that_exist(page):
    for path in re.findall(r"`(tests/[\w/]+\.py)`", page.read_text()):
        assert (DOCS.parent / path).exists(), path

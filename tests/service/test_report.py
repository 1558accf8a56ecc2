"""The printed report: self-contained, complete, honest about what is simulated and what is unknown."""

import copy
import re
from html.parser import HTMLParser

import pytest

from identify.diagnosis.diagnose import DiagnoseOptions
from service.diagnosing import diagnose_log
from service.report.page import report_html
from service.report.plots import before_after, curve_plot, misfit_map
from service.report.svg import number, ticks
from tests.service import changed_logs as changed
from tests.service import synthetic_logs as logs

VOID = {"meta", "link", "br", "img", "hr", "input"}


class Balanced(HTMLParser):
    """Checks that every tag is closed, and collects the text and the addresses."""

    def __init__(self):
        super().__init__()
        self.open, self.words, self.addresses = [], [], []

    def handle_starttag(self, tag, attrs):
        self.addresses += [v for k, v in attrs if k in ("src", "href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        pass

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


def read(html):
    page = Balanced()
    page.feed(html)
    assert page.open == []
    return page, " ".join(" ".join(page.words).split())


@pytest.fixture(scope="module")
def content(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    sticky = changed.with_torque(logs.recording(), changed.sticking(8.0, 0.2))
    logs.write(sticky, folder / "run.mcap")
    other = logs.recording(5, changed.VALIDATION, **changed.OTHER_MOTION)
    other = changed.with_torque(other, changed.sticking(8.0, 0.2), **changed.OTHER_MOTION)
    logs.write(other, folder / "validation.mcap")
    options = DiagnoseOptions(effects=("stribeck_friction", "load_dependent_friction"))
    return diagnose_log(folder / "run.mcap", "ir361", folder / "validation.mcap", options=options).content


@pytest.fixture
def page(content):
    return report_html(content)


def test_nothing_is_loaded_from_outside(page):
    found, _ = read(page)
    assert found.addresses == []
    assert "@import" not in page
    assert "url(" not in page
    assert "<script" not in page
    assert set(re.findall(r"https?://[^\"' ]+", page)) <= {"http://www.w3.org/2000/svg"}


def test_it_says_what_where_how_much_and_proves_it(page):
    _, text = read(page)
    for part in (
        "Stribeck friction in joint 2 explains what the model lacks",
        "On a recording not used in the fit the error of joint 2 falls from",
        "Where",
        "Which physics",
        "Before and after",
        "Torque constants",
        "Blind spots",
        "6 periods of 4 s",
        "run.mcap",
        "validation.mcap",
    ):
        assert part in text


def test_the_numbers_are_those_of_the_diagnosis(content, page):
    _, text = read(page)
    finding = content["findings"][0]
    for parameter in finding["parameters"]:
        assert number(parameter["value"], 4) in text
    for channel in ("joint_1", "joint_2", "force.x"):
        held = content["fit"]["validation"]
        assert f"{number(held['before'][channel])} → {number(held['after'][channel])}" in text


def test_simulated_data_is_stamped(content, page):
    assert "SIMULATED" in page
    measured = copy.deepcopy(content) | {"simulated": False}
    assert "SIMULATED" not in report_html(measured)


def test_the_measured_curve_lies_on_the_models(content):
    """Component plus residual: what is drawn as measured follows the effect within its noise."""
    (curve,) = content["curves"]
    assert (curve["channel"], curve["variable"]) == ("joint_2", "velocity:joint_2")
    pulls = [(m - p) / b for m, p, b in zip(curve["measured"], curve["model"], curve["band"], strict=True)]
    assert sum(abs(pull) < 3 for pull in pulls) >= 0.9 * len(pulls)
    assert max(abs(m) for m in curve["model"]) > 3 * max(curve["band"])


def test_the_map_points_at_the_joint(content):
    assert {entry["channel"] for entry in content["map"][:2]} == {"joint_2"}
    strongest = content["map"][0]
    assert len(strongest["sigma"]) == len(strongest["centres"])
    assert max(abs(s) for s in strongest["sigma"]) > 4


def test_alternatives_and_the_unexplained_are_shown(content):
    odd = copy.deepcopy(content)
    odd["findings"][0]["alternatives"] = ["presliding_friction", "backlash"]
    odd["verdict"] = "partly_explained"
    odd["unexplained"] = {
        "channels": ["joint_1"],
        "depends_on": ["position:joint_1"],
        "p_value": 1e-9,
        "sentence": "A rest is left.",
    }
    _, text = read(report_html(odd))
    assert "(or a look-alike)" in text
    assert "presliding friction" in text
    assert "something without a name is left" in text
    assert "A rest is left." in text
    assert "position of joint 1" in text


def test_nothing_found_is_a_page_too(content):
    quiet = copy.deepcopy(content) | {"findings": [], "curves": [], "map": [], "verdict": "consistent"}
    quiet["fit"]["validation"] = {"before": {}, "after": {}, "noise": {}}
    _, text = read(report_html(quiet))
    assert "explains this recording down to its noise" in text
    assert "No held-out recording was given" in text
    assert "Blind spots" in text


def test_a_rejected_recording_is_no_proof(content):
    odd = copy.deepcopy(content)
    reason = {"kind": "payload", "sentence": "It carries another load."}
    odd["fit"]["validation"] = {"before": {}, "after": {}, "noise": {}, "rejected": [reason]}
    _, text = read(report_html(odd))
    assert "It carries another load." in text
    assert "could not serve as proof" in text


def test_names_from_a_log_cannot_break_the_page(content):
    evil = copy.deepcopy(content)
    evil["robot"] = "<script>alert(1)</script>"
    evil["findings"][0]["sentence"] = "a < b & c > d <img src=x>"
    evil["warnings"] = ["</div><b>"]
    page = report_html(evil)
    assert "<script" not in page
    assert "<img" not in page
    read(page)


def test_the_comparison_with_a_simulation_is_drawn(content):
    odd = copy.deepcopy(content)
    share = {
        "difference": 2.0,
        "parameters": 1.0,
        "effects": 1.0,
        "rest": 1.0,
        "noise": 0.5,
        "simulation_rest": 0.0,
    }
    odd["against"] = {
        "kind": "simulation",
        "sentence": "They differ.",
        "parameters": [],
        "channels": {
            "joint_2": share | {"shares": {"parameters": 0.5, "effects": 0.3, "noise": 0.1, "rest": 0.1}}
        },
    }
    _, text = read(report_html(odd))
    assert "Against the simulation" in text
    assert "50 %" in text


def test_empty_parts_draw_nothing():
    assert misfit_map([], ["joint_1"]) == ""
    assert before_after({"before": {}, "after": {}, "noise": {}}, "none") == ""
    empty = {key: [] for key in ("x", "measured", "band", "model")}
    assert (
        curve_plot({**empty, "channel": "joint_1", "variable": "time", "unit": "s", "value_unit": "N.m"})
        == ""
    )


@pytest.mark.parametrize(("low", "high"), [(0.0, 1.0), (-3.7, 12.1), (1e-6, 3e-6), (-2000.0, 90000.0)])
def test_ticks_are_few_round_and_inside(low, high):
    found = ticks(low, high)
    assert 3 <= len(found) <= 12
    assert all(low - 1e-9 * abs(low) <= value <= high * (1 + 1e-9) for value in found)


def test_the_command_writes_the_report(tmp_path, capsys):
    logs.write(logs.recording(), tmp_path / "run.mcap")
    out = tmp_path / "report.html"
    arguments = ("diagnose", tmp_path / "run.mcap", "--robot", "ir361", "--report", out)
    code, printed, err = logs.command(capsys, *arguments)
    assert (code, err) == (0, "")
    assert str(out) in printed
    read(out.read_text())


def test_a_report_into_no_folder_is_refused_before_the_work(tmp_path, capsys):
    logs.write(logs.recording(), tmp_path / "run.mcap")
    arguments = (
        "diagnose",
        tmp_path / "run.mcap",
        "--robot",
        "ir361",
        "--report",
        tmp_path / "no" / "r.html",
    )
    assert "does not exist" in logs.refused(capsys, 2, *arguments)

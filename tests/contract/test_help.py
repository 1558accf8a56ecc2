"""The command line explains itself, and the repository says nothing of where its packages come from."""

import re
import subprocess
from pathlib import Path

import pytest

from service.cli.main import COMMANDS, run

ROOT = Path(__file__).parents[2]


def help_of(capsys, *words):
    assert run([*words, "--help"]) == 0
    return capsys.readouterr().out


def test_the_root_lists_every_command(capsys):
    text = help_of(capsys)
    for name, (_, line) in COMMANDS.items():
        assert re.search(rf"^\s+{name}\s", text, re.MULTILINE), name
        assert line.split()[0] in text
    assert "Example: residuum" in text


@pytest.mark.parametrize("name", COMMANDS)
def test_help_ends_with_an_example(capsys, name):
    text = help_of(capsys, name)
    assert text.startswith("Usage: residuum")
    description = text.split("Options:")[0]
    assert f"Example: residuum {name}" in " ".join(description.split())
    assert "--json" in text


def test_an_unknown_command_is_wrong_use(capsys):
    assert run(["identfy"]) == 2
    assert "Traceback" not in capsys.readouterr().err


def test_an_unknown_option_is_wrong_use(capsys):
    assert run(["identify", "run.mcap", "--robbot", "ir361"]) == 2
    assert "--robbot" in capsys.readouterr().err


def committed_files():
    result = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False)
    if result.returncode != 0:
        pytest.skip("not a git checkout")
    return [ROOT / name for name in result.stdout.split("\0") if name and (ROOT / name).is_file()]


def test_no_committed_file_holds_the_address_of_a_package_index():
    option = r"--(extra-)?index-" + "url"
    address = r"https?://[^\s\"']*(pypi\.|/simp" + r"le\b|artifactory|/pypi/)"
    pattern = re.compile(f"({option}|{address}|trusted-" + r"host)", re.IGNORECASE)
    found = []
    for path in committed_files():
        if path.suffix in (".mcap", ".png", ".npz", ".db3"):
            continue
        text = path.read_text(encoding="utf-8", errors="replace")
        found += [f"{path.relative_to(ROOT)}: {match.group(0)}" for match in pattern.finditer(text)]
    assert found == []


def test_help_imports_nothing_heavy():
    """Numbers and plots are not needed to print help: numpy, scipy, mujoco and rich stay unloaded."""
    import sys

    script = (
        "import sys; from service.cli.main import run; run(['--help']);"
        "heavy = {'numpy', 'scipy', 'mujoco', 'fastapi', 'sqlalchemy', 'can'} & set(sys.modules);"
        "sys.exit(f'loaded: {heavy}' if heavy else 0)"
    )
    result = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr

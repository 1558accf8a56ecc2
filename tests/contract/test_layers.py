"""Who may import whom, as the contracts in pyproject.toml say."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def lint_imports(folder):
    command = [str(Path(sys.executable).with_name("lint-imports")), "--no-cache"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_the_layers_hold():
    result = lint_imports(ROOT)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "0 broken" in result.stdout


def test_the_check_can_fail(tmp_path):
    """The same contracts refuse a package that breaks them."""
    for package in ("daq", "drivers", "identify", "service"):
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").write_text("")
    for part in ("canopen", "force_plate"):
        (tmp_path / "drivers" / part).mkdir()
        (tmp_path / "drivers" / part / "__init__.py").write_text("")
    (tmp_path / "pyproject.toml").write_text((ROOT / "pyproject.toml").read_text())
    (tmp_path / "identify" / "clock.py").write_text("import time\nimport daq\n")
    result = lint_imports(tmp_path)
    assert result.returncode != 0
    assert "identify stands alone" in result.stdout

import subprocess
import sys

import deli


def test_what_is_exported_exists():
    for name in deli.__all__:
        assert hasattr(deli, name), name


def test_a_stranger_called_solvers_is_named(tmp_path):
    stranger = tmp_path / "solvers.py"
    stranger.write_text("")
    found = subprocess.run([sys.executable, "-c", "import deli"], cwd=tmp_path, capture_output=True, text=True)
    assert found.returncode == 1
    assert "ImportError: deli needs its own package 'solvers', but Python found another one first" in found.stderr
    assert str(stranger) in found.stderr


def test_a_stray_folder_called_solvers_is_named(tmp_path):
    (tmp_path / "solvers").mkdir()
    (tmp_path / "solvers" / "__init__.py").write_text("")
    found = subprocess.run([sys.executable, "-c", "import deli"], cwd=tmp_path, capture_output=True, text=True)
    assert found.returncode == 1
    assert str(tmp_path / "solvers" / "__init__.py") in found.stderr

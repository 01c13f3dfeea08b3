import pytest


@pytest.mark.parametrize(
    "option", [["--rate"], ["--lock-timeout"], ["--source-rate"], ["--unit"], ["--jobs"]]
)
def test_nan_is_no_number(mocapidx, tmp_path, option):
    done = mocapidx("index", tmp_path, "--store", tmp_path / "s.store", *option, "nan")
    assert done.returncode == 2
    assert done.stderr.startswith(f"Error: Invalid value for '{option[0]}': 'nan' is not a")
    assert not (tmp_path / "s.store").exists()

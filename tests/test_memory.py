"""Memory is asked before it is used."""

import subprocess
import sys

import pytest

import umbrae.memory
from umbrae.errors import CapacityError
from umbrae.memory import available_bytes, require


def test_there_is_some_memory() -> None:
    assert 1 << 20 < available_bytes() < 1 << 60


def test_the_message_carries_both_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(umbrae.memory, "available_bytes", lambda: 3 << 30)
    require(3 << 30, "just enough")
    with pytest.raises(CapacityError) as caught:
        require(5 << 30, "a tower")
    assert str(caught.value) == "a tower needs 5.00 GiB of memory, 3.00 GiB are available"


def test_the_tightest_control_group_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(umbrae.memory, "_machine_bytes", lambda: 1000)
    monkeypatch.setattr(umbrae.memory, "_group_bytes", lambda: iter([700, 900]))
    assert available_bytes() == 700
    monkeypatch.setattr(umbrae.memory, "_group_bytes", lambda: iter([-5]))
    assert available_bytes() == 0


@pytest.mark.skipif(sys.platform == "win32", reason="there are no such limits")
def test_the_limit_of_the_process_counts() -> None:
    limit = 4 << 30
    code = f"""if True:
        import resource
        from umbrae.memory import available_bytes
        before = available_bytes()
        resource.setrlimit(resource.RLIMIT_AS, ({limit}, {limit}))
        print(before, available_bytes())"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    before, after = map(int, done.stdout.split())
    assert 0 < after < limit and after <= before

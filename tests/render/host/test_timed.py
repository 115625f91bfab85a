"""A call's time is that of its kernels too."""

from types import SimpleNamespace

from onespp.render.host.timed import timed


def test_the_clock_is_read_when_no_kernel_is_at_work(monkeypatch):
    """0.25 s of kernels asked for before do not count, 0.5 s in the call and 2 s after it do."""
    said, clock, queued = [], [10.0], [0.25]

    def sync() -> None:
        said.append("sync")
        clock[0] += queued.pop() if queued else 0

    def call() -> str:
        said.append("call")
        clock[0] += 0.5
        queued.append(2.0)
        return "image"

    def now() -> float:
        said.append("clock")
        return clock[0]

    monkeypatch.setattr("onespp.render.host.timed.dr", SimpleNamespace(sync_thread=sync))
    monkeypatch.setattr("onespp.render.host.timed.time", SimpleNamespace(perf_counter=now))
    assert timed(call) == ("image", 2500.0)
    assert said == ["sync", "clock", "call", "sync", "clock"]

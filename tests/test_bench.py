"""The benchmark harness on scenes of a few triangles, with runners that behave and runners that do not."""

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from rich.console import Console

import umbrae as um
from umbrae.bench import benchmark as benchmark_room
from umbrae.bench import table
from umbrae.bench.bars import allowed_bytes, bars
from umbrae.bench.benchmark import Benchmark
from umbrae.bench.case import STEP, Case, cases, views
from umbrae.bench.peak import peak_bytes
from umbrae.bench.record import CaseResult, Record, RunnerResult, Times
from umbrae.bench.runner import MethodRunner, Runner, exact_methods
from umbrae.bench.scenes import FULL, QUICK, SCENES, BenchScene, extent
from umbrae.mask import Guarantee, ShadowMask
from umbrae.methods import METHODS, make_method
from umbrae.sampling import sample


def roof():
    """A triangle that hovers one unit above a larger one, neither in the plane of the other."""
    floor, cover = [(-3, 0, 3), (3, 0, 3), (0, 0, -4)], [(-1, 1, 1), (1, 1, 1.5), (0, 1.25, -1)]
    return um.Scene(floor + cover, [(0, 1, 2), (3, 4, 5)])


class Right(MethodRunner):
    """The frustum method; counts what it is asked, and remembers with what."""

    def __init__(self, name="right", missing=None):
        super().__init__(METHODS["frustum"]())
        self.name, self._missing = name, missing
        self.scenes, self.lights, self.cameras = [], [], []

    def unavailable(self):
        return self._missing

    def set_geometry(self, scene):
        self.scenes.append(scene)
        super().set_geometry(scene)

    def set_samples(self, samples):
        self.cameras.append(tuple(samples.camera.eye))
        super().set_samples(samples)

    def shadow(self, light, clock):
        self.lights.append(tuple(light.position))
        with clock.span("decide"):
            return super().shadow(light, clock)


class AllLit(Right):
    """Says that nothing is in shadow."""

    def __init__(self, name, guarantee):
        super().__init__(name)
        self.guarantee = guarantee

    def mask(self, answer):
        return ShadowMask(np.zeros(answer.in_shadow.shape, bool), self.guarantee)


class WrongWhenWarm(Right):
    """Keeps what it answered for the light before."""

    def prepare(self, clock):
        self._first = None
        super().prepare(clock)

    def shadow(self, light, clock):
        self._first = self._first or super().shadow(light, clock)
        return self._first


class NoMemory(Right):
    def prepare(self, clock):
        raise um.CapacityError("needs 999.00 GiB of memory")


@pytest.fixture(autouse=True)
def tiny(monkeypatch):
    monkeypatch.setitem(SCENES, "tiny", BenchScene(roof))
    monkeypatch.setitem(SCENES, "lost", BenchScene("no/such.glb"))


def make(*runners, scenes=("tiny",), lights=("point",), sizes=((32, 18),), runs=2, **options):
    return Benchmark(scenes, lights, sizes, runs, 200, runners, **options)


def carry_out(plan, record=None, keep=lambda record: None):
    return plan.run(record or plan.record(), keep, um.Clock())


def shown(record, width=80):
    console = Console(width=width, record=True, file=open("/dev/null", "w"), highlight=False)  # noqa: SIM115
    table.show(record, console)
    console.file.close()
    return console.export_text()


def test_statistics_of_known_numbers():
    times = Times.of([4.0, 1.0, 2.0, 3.0, 10.0])
    assert times == Times((4.0, 1.0, 2.0, 3.0, 10.0), 1.0, 3.0, (2.0, 4.0))
    assert Times.of([0.25]) == Times((0.25,), 0.25, 0.25, (0.25, 0.25))


def test_a_case_has_cold_and_warm_times_stages_and_a_verdict():
    plan = make(Right(), runs=3)
    (result,) = carry_out(plan).cases
    assert (result.triangles, result.samples, result.not_run) == (2, 32 * 18, None)
    assert 0 < result.covered < result.samples
    (runner,) = result.runners
    assert (runner.name, runner.guarantee, runner.not_run, runner.wrong, runner.broken) == (
        *("right", "exact", None, 0, False),
    )
    # Half of the 200 for each of the two masks, of fewer covered samples perhaps.
    assert runner.checked == 2 * min(100, result.covered)
    assert set(runner.seconds) == {"build", "trace", "cold", "warm"}
    for times in runner.seconds.values():
        assert len(times.runs) == 3 and all(seconds >= 0 for seconds in times.runs)
    parts = zip(*(runner.seconds[kind].runs for kind in ("cold", "build", "trace")), strict=True)
    assert all(cold == pytest.approx(build + trace, abs=2e-7) for cold, build, trace in parts)
    assert "decide" in runner.stages and runner.stages["decide"] > 0


def test_every_run_has_new_arrays_another_camera_and_another_light():
    runner = Right()
    carry_out(make(runner, runs=3))
    # Two warm-ups, three runs, one for the memory.
    assert len(runner.scenes) == 6
    first = runner.scenes[0]
    for other in runner.scenes[1:]:
        assert not np.shares_memory(first.positions, other.positions)
        assert (first.positions == other.positions).all()
    # Warm and cold of a run share the light, which is new to the geometry that the warm one still has.
    assert len(set(runner.lights)) == 5 and len(set(runner.cameras)) == 5


def test_views_move_by_a_thousandth_of_the_extent():
    scene = roof()
    assert extent(scene) == 7.0
    seen = views(Case("tiny", "point", 32, 18), scene, 2)
    assert len(seen) == 4
    for one, next_one in pairwise(seen):
        assert np.linalg.norm(next_one.camera.eye - one.camera.eye) == pytest.approx(7 * STEP)
        step = next_one.light.position - one.light.position
        assert step == pytest.approx((7 * STEP, 0, 3.5 * STEP, 0), abs=1e-6)
    for view in views(Case("tiny", "directional", 32, 18), scene, 2):
        assert view.light.is_directional


def test_all_combinations_scene_by_scene():
    made = cases(["a", "b"], ["point", "directional"], [(4, 2), (8, 4)])
    assert [str(case) for case in made[:4]] == [
        *("a point 4x2", "a directional 4x2", "a point 8x4", "a directional 8x4")
    ]
    assert len(made) == 8 and {case.scene for case in made[4:]} == {"b"}


def test_a_broken_guarantee_gets_no_time_but_a_loud_mark():
    record = carry_out(make(Right(), AllLit("liar", Guarantee.EXACT)))
    (result,) = record.cases
    liar = result.runner("liar")
    assert record.broken and liar.broken and liar.wrong > 0
    assert not liar.seconds and not liar.stages
    assert result.runner("right").seconds
    text = shown(record)
    assert "WRONG: liar promises exact verdicts, but" in text and "differ from the oracle: no time" in " ".join(
        text.split()
    )


def test_a_mask_that_is_wrong_only_with_prepared_geometry_is_found():
    # Both lights are in the same place but for a small step, so many samples are needed.
    plan = Benchmark(["tiny"], ["point"], [(400, 300)], 2, 10**6, [WrongWhenWarm()])
    assert carry_out(plan).cases[0].runners[0].broken


def test_a_comparator_keeps_its_time_beside_its_share_of_wrong_samples():
    record = carry_out(make(AllLit("rough", Guarantee.NONE)))
    (runner,) = record.cases[0].runners
    assert not record.broken and runner.wrong > 0 and runner.seconds["warm"].median > 0
    assert f"{runner.wrong / runner.checked:.2%}" in shown(record)


def test_who_cannot_run_is_marked_with_the_reason():
    record = carry_out(make(Right(), Right("ghost", missing="ghost is not installed"), NoMemory("greedy")))
    (result,) = record.cases
    assert result.runner("ghost").not_run == "ghost is not installed"
    assert result.runner("greedy").not_run == "needs 999.00 GiB of memory"
    assert result.runner("right").seconds
    text = shown(record)
    assert "ghost not run: ghost is not installed" in text and "greedy not run: needs 999.00 GiB" in text


def test_a_missing_model_is_marked_and_the_rest_measured(tmp_path):
    record = carry_out(make(Right(), scenes=("lost", "tiny"), models=tmp_path))
    lost, tiny = record.cases
    assert lost.not_run == f"model no/such.glb not found in {tmp_path} (give --models)"
    assert tiny.not_run is None and tiny.runners[0].seconds
    assert "not run: model no/such.glb not found" in shown(record)
    nowhere = carry_out(make(Right(), scenes=("lost",)))
    assert nowhere.cases[0].not_run == "model no/such.glb not found: no folder of models (give --models)"


def test_a_record_survives_the_file(tmp_path):
    record = carry_out(make(Right(), AllLit("rough", Guarantee.NONE), scenes=("lost", "tiny")))
    record.save(tmp_path / "a.json")
    again = Record.load(tmp_path / "a.json")
    assert again.cases == record.cases
    record.check_same(tmp_path / "a.json", again)
    document = json.loads((tmp_path / "a.json").read_text())
    assert list(document) == ["schema", "benchmark", "configuration", "machine", "date", "cases"]
    assert set(document["machine"]) == {
        *(
            "cpu",
            "cores",
            "threads",
            "memory_bytes",
            "opengl",
            "system",
            "python",
            "versions",
            "commit",
            "sources",
            "dirty",
        )
    }
    assert set(document["configuration"]) == {"scenes", "lights", "sizes", "runs", "checked", "runners", "path"}
    assert set(document["cases"][1]["runners"][0]["seconds"]["cold"]) == {"runs", "minimum", "median", "quartiles"}


def test_an_interruption_leaves_the_finished_cases_and_resuming_does_the_others(tmp_path, monkeypatch):
    file = tmp_path / "a.json"
    measured = []
    measure = benchmark_room.measure

    def counting(case, *others):
        if len(measured) == 2:
            raise KeyboardInterrupt
        measured.append(case)
        return measure(case, *others)

    monkeypatch.setattr(benchmark_room, "measure", counting)
    plan = make(Right(), lights=("point", "directional"), sizes=((32, 18), (16, 9)))
    with pytest.raises(KeyboardInterrupt):
        carry_out(plan, keep=lambda record: record.save(file))
    kept = Record.load(file)
    assert [result.case for result in kept.cases] == measured and len(measured) == 2
    monkeypatch.setattr(
        benchmark_room, "measure", lambda case, *others: measured.append(case) or measure(case, *others)
    )
    whole = carry_out(plan, kept)
    assert len(measured) == len(set(measured)) == 4
    assert whole.cases[:2] == kept.cases


def test_resuming_tries_again_what_could_not_be_loaded(tmp_path):
    plan = make(Right(), scenes=("lost",), models=tmp_path)
    record = carry_out(plan)
    assert record.cases[0].not_run is not None
    (tmp_path / "no").mkdir()
    um.save(roof(), tmp_path / "no" / "such.glb")
    (result,) = carry_out(plan, record).cases
    assert result.not_run is None and result.runners[0].seconds


@pytest.mark.parametrize(("change", "name"), [({"runs": 3}, "runs"), ({"lights": ("directional",)}, "lights")])
def test_resuming_refuses_another_configuration(tmp_path, change, name):
    with pytest.raises(um.InputError, match=f"cannot be resumed: it was made with {name} "):
        make(Right()).record().check_same(tmp_path / "a.json", make(Right(), **change).record())


def test_resuming_refuses_other_sources_but_not_another_commit(tmp_path):
    record = make(Right()).record()
    earlier = replace(record, machine={**record.machine, "commit": "other"})
    record.check_same(tmp_path / "a.json", earlier)
    with pytest.raises(um.InputError, match='made with sources "other"'):
        record.check_same(tmp_path / "a.json", replace(record, machine={**record.machine, "sources": "other"}))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "damaged, or no JSON"),
        ('{"schema": 1, ', "damaged, or no JSON"),
        ("[]", "schema 1"),
        ('{"schema": 2}', "schema 1"),
        ('{"schema": 1}', "damaged: KeyError 'cases'"),
        ('{"schema": 1, "cases": 3}', "damaged: TypeError"),
        ('{"schema": 1, "cases": [{}]}', "damaged: KeyError 'runners'"),
        ("\xff", "not a text"),
    ],
)
def test_damaged_files_end_in_one_line(tmp_path, content, message):
    file = tmp_path / "a.json"
    file.write_bytes(content.encode("latin-1"))
    with pytest.raises(um.InputError) as caught:
        Record.load(file)
    assert message in str(caught.value) and str(file) in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("where", "value"),
    [("triangles", "x"), ("seconds", {}), ("seconds", {"cold": {"runs": [1.0]}}), ("runs", []), ("peak_bytes", "much")],
)
def test_damaged_values_end_in_one_line(tmp_path, where, value):
    file = tmp_path / "a.json"
    make(Right()).run(make(Right()).record(), lambda record: record.save(file), um.Clock())
    Record.load(file)
    document = json.loads(file.read_text())
    case = document["cases"][0]
    runner = case["runners"][0]
    place = case if where == "triangles" else runner["seconds"]["warm"] if where == "runs" else runner
    place[where] = value
    file.write_text(json.dumps(document))
    with pytest.raises(um.InputError, match="damaged"):
        Record.load(file)


def result_of(case, seconds, peak=None):
    """A made-up case: seconds of cold and warm runs by runner."""
    runners = [
        RunnerResult(
            name, "none" if name == "mitsuba" else "exact", checked=10,
            seconds={kind: Times.of([value]) for kind, value in zip(("build", "trace", "cold", "warm"), times)},  # noqa: B905
            peak_bytes=peak,
        )
        for name, times in seconds.items()
    ]  # fmt: skip
    return CaseResult(case, 1000, case.width * case.height, 1000, None, tuple(runners))


def test_bars_are_ratios_of_medians():
    small, large = Case("city", "point", 100, 50), Case("city", "point", 200, 100)
    record = Record("rays", {}, {}, "").with_case(
        result_of(small, {"frustum": (0, 2, 2.0, 1.0), "mitsuba": (8, 2, 12.0, 2.0)}, peak=150_000)
    )
    record = record.with_case(result_of(large, {"frustum": (0, 3, 3.0, 2.5)}))
    assert allowed_bytes(record.cases[0]) == 100 * 1000 + 40 * 5000 == 300_000
    one, two = bars(record)
    assert (one.cold, one.warm, one.memory, one.growth_cold, one.growth_warm) == (6.0, 2.0, 0.5, None, None)
    assert (two.cold, two.warm, two.memory, two.growth_cold, two.growth_warm) == (None, None, None, 1.5, 2.5)
    text = shown(record)
    assert "6.00 " in text and "2.00 " in text and "1.5 2.5!" in text


def test_tables_fit_80_columns_with_large_numbers():
    case = Case("spheres-980k", "directional", 3840, 2160)
    slow = (12.3456, 9.8765, 22.2221, 9.8765)
    record = Record("rays", {}, {}, "").with_case(
        result_of(case, {"frustum": slow, "mitsuba": slow, "embreex": slow}, peak=9_000 << 20)
    )
    lines = shown(record).splitlines()
    assert max(len(text) for text in lines) <= 80
    for figure in ("12,346", "9,876", "22,222", "9,000"):
        assert figure in shown(record)
    assert not any("…" in text for text in lines)


def test_the_peak_is_that_of_the_work_alone():
    def work():
        return np.ones(64 << 20, np.uint8).sum()

    peak = peak_bytes(work)
    if peak is None:
        pytest.skip("this system does not tell the peak of the memory")
    assert 60 << 20 < peak < 80 << 20
    assert peak_bytes(lambda: None) < 4 << 20


def test_every_exact_method_but_the_oracle_takes_part():
    names = [runner.name for runner in exact_methods()]
    assert "frustum" in names and "oracle" not in names
    for runner in exact_methods():
        assert isinstance(runner, Runner) and runner.options() == METHODS[runner.name]().options()


def test_the_named_scenes_are_there():
    assert set(QUICK) | set(FULL) < set(SCENES)
    assert not any(isinstance(SCENES[name].source, str) for name in QUICK)


@pytest.mark.parametrize("directional", [True, False])
def test_the_light_sees_all_samples_of_the_grazed_ground_in_a_line(directional):
    setup = SCENES["grazed"]
    scene = setup.load(None)
    light, samples = setup.light(scene, directional), sample(scene, setup.camera(scene, 96, 54))
    assert samples.covered.all()
    seen = samples.position.astype(np.float64) - (0.0 if directional else light.position[:3])
    axis = light.position[:3] / np.linalg.norm(light.position[:3])
    depth = seen @ axis
    if not directional:
        seen = seen / depth[..., None]
    flat = (seen - (seen @ axis)[..., None] * axis).reshape(-1, 3)
    _, spread, _ = np.linalg.svd(flat - flat.mean(axis=0), full_matrices=False)
    assert spread[1] < 0.01 * spread[0]
    dark = make_method("frustum").prepare(scene).shadow(light, samples).in_shadow
    assert 0.2 < dark.mean() < 0.95

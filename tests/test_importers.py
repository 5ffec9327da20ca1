"""Sound files and tables as recordings."""

from __future__ import annotations

import numpy as np
import pytest
import soundfile
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.bag_cases import axes, operation
from turnmill_core.monitoring.blocks import Status
from turnmill_ros.bag import bag_info, check_bag, read_bag
from turnmill_ros.conversions import block_from_message, operation_from_message
from turnmill_ros.errors import InputError
from turnmill_ros.importers import import_csv, import_sound

OP = operation()


def _blocks(path):
    return [block_from_message(message) for _, _, message in read_bag(path, ["sensor_blocks"])]


def _joined(path):
    return np.concatenate([block.samples for block in _blocks(path)])


def _sound(path, samples, rate=48_000, subtype="PCM_16"):
    soundfile.write(path, samples, rate, subtype=subtype)
    return path


@pytest.mark.parametrize(("subtype", "step"), [("PCM_16", 2.0**-15), ("PCM_24", 2.0**-23), ("FLOAT", 1e-7)])
def test_samples_of_all_channels_come_through(tmp_path, subtype, step):
    samples = np.random.default_rng(0).uniform(-0.9, 0.9, size=(10_007, 2))
    done = import_sound(_sound(tmp_path / "cut.wav", samples, subtype=subtype), OP, tmp_path / "cut.mcap")
    assert (done.channels, done.sample_rate, done.samples) == (("mic1", "mic2"), 48_000.0, 10_007)
    assert np.abs(_joined(tmp_path / "cut.mcap") - samples).max() <= step
    assert "scale is unknown" in done.notes[0]
    assert {f.code for f in check_bag(tmp_path / "cut.mcap")} == {"no_axis_states"}


def test_blocks_are_20_ms_and_counted_without_gaps(tmp_path):
    import_sound(_sound(tmp_path / "cut.wav", np.zeros(10_007)), OP, tmp_path / "cut.mcap", start_ns=5_000_000_000)
    blocks = _blocks(tmp_path / "cut.mcap")
    assert [len(b.samples) for b in blocks] == [960] * 10 + [407]
    assert [b.first_sample for b in blocks] == [960 * k for k in range(11)]
    assert [b.stamp_ns for b in blocks] == [5_000_000_000 + 20_000_000 * k for k in range(11)]
    assert {b.device for b in blocks} == {"cut"}
    assert blocks[0].channels[0].status == Status.UNCALIBRATED


def test_operation_stands_first_and_in_the_metadata(tmp_path):
    import_sound(_sound(tmp_path / "cut.wav", np.zeros(960)), OP, tmp_path / "cut.mcap")
    topic, _, message = next(read_bag(tmp_path / "cut.mcap"))
    assert topic == "/operation"
    assert operation_from_message(message) == OP
    metadata = bag_info(tmp_path / "cut.mcap").metadata
    assert metadata["operation"]["sha256"] == OP.sha256
    assert metadata["import"] == {"source": "cut.wav"}


def test_samples_at_full_scale_are_flagged(tmp_path):
    samples = np.zeros((1920, 2))
    samples[1000, 1] = 1.0
    done = import_sound(_sound(tmp_path / "loud.wav", samples), OP, tmp_path / "loud.mcap", unit="Pa")
    flags = [[c.status for c in block.channels] for block in _blocks(tmp_path / "loud.mcap")]
    assert flags == [[Status.OK, Status.OK], [Status.OK, Status.SATURATED]]
    assert any("1 blocks reach full scale" in note for note in done.notes)
    import_sound(_sound(tmp_path / "float.wav", 2 * samples, subtype="FLOAT"), OP, tmp_path / "float.mcap")
    assert all(c.status == Status.UNCALIBRATED for b in _blocks(tmp_path / "float.mcap") for c in b.channels)


def test_axis_states_are_recorded_in_their_place(tmp_path):
    states = [axes(1_000_000_000 + 50_000_000 * k) for k in range(5)]
    import_sound(_sound(tmp_path / "cut.wav", np.zeros(4800)), OP, tmp_path / "cut.mcap", axes=states)
    stamps = [log_ns for _, log_ns, _ in read_bag(tmp_path / "cut.mcap", ["joint_states"])]
    assert stamps == [state.stamp_ns for state in states]
    assert [m.log_time_ns for m in read_bag(tmp_path / "cut.mcap")] == sorted(
        m.log_time_ns for m in read_bag(tmp_path / "cut.mcap"))


@pytest.mark.parametrize(("options", "text"), [
    ({"sample_rate": 44_100.0}, r"cut\.wav: sample rate: declared .* not the file's: '44100 Hz'; expected 48000 Hz"),
    ({"quantity": "loudness"}, "unknown quantity: 'loudness'; expected sound_pressure"),
    ({"unit": "mV"}, "unit of sound_pressure: 'mV'; expected Pa, or 1"),
    ({"names": ["a", "b"]}, "expected 1 names"),
])
def test_sound_that_is_not_as_declared_is_refused(tmp_path, options, text):
    with pytest.raises(InputError, match=text):
        import_sound(_sound(tmp_path / "cut.wav", np.zeros(960)), OP, tmp_path / "cut.mcap", **options)
    assert [p.name for p in tmp_path.iterdir()] == ["cut.wav"]


@pytest.mark.parametrize("content", [b"", b"RIFF\0\0\0\0WAVE", b"time,a\n0,1\n", None])
def test_files_that_are_no_sound_are_refused(tmp_path, content):
    if content is not None:
        (tmp_path / "cut.wav").write_bytes(content)
    with pytest.raises(InputError, match=r"cut\.wav: "):
        import_sound(tmp_path / "cut.wav", OP, tmp_path / "cut.mcap")
    assert not (tmp_path / "cut.mcap").exists()


def test_sound_without_samples_is_refused(tmp_path):
    with pytest.raises(InputError, match="holds no samples"):
        import_sound(_sound(tmp_path / "cut.wav", np.zeros(0)), OP, tmp_path / "cut.mcap")


def test_sound_cut_short_gives_what_is_there_and_says_so(tmp_path):
    whole = _sound(tmp_path / "cut.wav", np.full(9600, 0.5)).read_bytes()
    (tmp_path / "cut.wav").write_bytes(whole[: 44 + 2 * 5000])
    done = import_sound(tmp_path / "cut.wav", OP, tmp_path / "cut.mcap")
    assert done.samples == len(_joined(tmp_path / "cut.mcap")) == 5000
    assert any("cut off" in note for note in done.notes)


def test_damaged_sound_is_refused(tmp_path):
    soundfile.write(tmp_path / "cut.flac", np.random.default_rng(0).uniform(-0.5, 0.5, 48_000), 48_000)
    content = (tmp_path / "cut.flac").read_bytes()
    (tmp_path / "cut.flac").write_bytes(content[: len(content) // 2])
    with pytest.raises(InputError, match=r"cut\.flac: the sound file is damaged"):
        import_sound(tmp_path / "cut.flac", OP, tmp_path / "cut.mcap")
    assert [p.name for p in tmp_path.iterdir()] == ["cut.flac"]


def test_existing_output_is_kept(tmp_path):
    (tmp_path / "cut.mcap").write_bytes(b"precious")
    with pytest.raises(InputError, match="output exists"):
        import_sound(_sound(tmp_path / "cut.wav", np.zeros(960)), OP, tmp_path / "cut.mcap")
    assert (tmp_path / "cut.mcap").read_bytes() == b"precious"


def _csv(path, time, columns, header, delimiter=",", form="{:.12g}"):
    cells = (["" if np.isnan(v) else form.format(v) for v in row] for row in zip(time, *columns, strict=True))
    rows = [delimiter.join(row) for row in cells]
    path.write_text("\n".join([delimiter.join(header), *rows]) + "\n", "utf-8")
    return path


@given(st.floats(500, 20_000), st.floats(0.001, 100.0), st.integers(60, 200))
@settings(deadline=None, max_examples=25)
def test_table_gives_rate_times_and_samples(tmp_path_factory, rate, start, count):
    folder = tmp_path_factory.mktemp("csv")
    time = start + np.arange(count) / rate
    values = np.random.default_rng(count).normal(size=(2, count))
    file = _csv(folder / "cut.csv", time, values, ["Time (s)", "X (m/s^2)", "Y (mm)"])
    done = import_csv(file, OP, folder / "cut.mcap")
    assert done.sample_rate == pytest.approx(rate, rel=1e-6)
    assert done.channels == ("X", "Y")
    blocks = _blocks(folder / "cut.mcap")
    assert [(c.quantity, c.unit) for c in blocks[0].channels] == [("acceleration", "m/s2"), ("displacement", "m")]
    assert np.allclose(_joined(folder / "cut.mcap"), (values * [[1.0], [1e-3]]).T, rtol=1e-6)
    assert blocks[-1].stamp_ns == pytest.approx(time[blocks[-1].first_sample] * 1e9, abs=2000)


TIME = 3.0 + np.arange(400) / 1600


def test_gaps_in_time_stay_gaps(tmp_path):
    keep = np.r_[0:100, 130:250, 251:400]
    file = _csv(tmp_path / "cut.csv", TIME[keep], [np.arange(400.0)[keep]], ["time", "a [V]"])
    done = import_csv(file, OP, tmp_path / "cut.mcap")
    samples = {block.first_sample + k: value for block in _blocks(tmp_path / "cut.mcap")
               for k, value in enumerate(block.samples[:, 0])}
    assert samples == {int(k): float(k) for k in keep}
    assert "2 gaps with 31 missing samples" in done.notes
    assert ("warning", "gap", 2) in {(f.severity, f.code, f.count) for f in check_bag(tmp_path / "cut.mcap")}


def test_missing_values_become_bad_samples_and_are_counted(tmp_path):
    values = np.ones(400)
    values[[5, 77]] = np.nan
    file = _csv(tmp_path / "cut.csv", TIME, [values, np.ones(400)], ["time", "a [N]", "b [N]"])
    done = import_csv(file, OP, tmp_path / "cut.mcap")
    assert np.flatnonzero(np.isnan(_joined(tmp_path / "cut.mcap")[:, 0])).tolist() == [5, 77]
    assert any(note.startswith("2 samples are not finite") for note in done.notes)


def test_small_jitter_is_told_and_large_jitter_refused(tmp_path):
    jitter = np.random.default_rng(0).uniform(-1, 1, 400) / 1600
    header = ["time", "a [N]"]
    done = import_csv(_csv(tmp_path / "a.csv", TIME + 0.04 * jitter, [TIME], header), OP, tmp_path / "a.mcap")
    assert any("off an even grid" in note for note in done.notes)
    with pytest.raises(InputError, match=r"time: samples are not uniform in time"):
        import_csv(_csv(tmp_path / "b.csv", TIME + 0.3 * jitter, [TIME], header), OP, tmp_path / "b.mcap")


def test_other_notations_of_a_table_are_understood(tmp_path):
    """Semicolons and decimal commas, milliseconds, a byte order mark, g, columns by choice."""
    text = "\ufefft [ms];Accel [g];Note\n" + "".join(f"{k / 2:.1f};{k / 10};7\n".replace(".", ",") for k in range(100))
    (tmp_path / "cut.csv").write_text(text, "utf-8")
    done = import_csv(tmp_path / "cut.csv", OP, tmp_path / "cut.mcap")
    assert done.sample_rate == pytest.approx(2000.0)
    assert done.channels == ("Accel",)
    assert "columns without a unit were left out: Note" in done.notes
    assert any("stamped 1970-01-01" in note for note in done.notes)
    assert _joined(tmp_path / "cut.mcap")[50, 0] == pytest.approx(5.0 * 9.80665)
    chosen = import_csv(tmp_path / "cut.csv", OP, tmp_path / "two.mcap", columns=["Note"], unit="V")
    assert chosen.channels == ("Note",)


def test_table_without_time_needs_a_rate(tmp_path):
    (tmp_path / "cut.csv").write_text("a,b\n" + "1,2\n" * 50)
    with pytest.raises(InputError, match="no time column"):
        import_csv(tmp_path / "cut.csv", OP, tmp_path / "cut.mcap", unit="V")
    done = import_csv(tmp_path / "cut.csv", OP, tmp_path / "cut.mcap", unit="V", sample_rate=1000.0)
    assert (done.sample_rate, done.samples, done.channels) == (1000.0, 50, ("a", "b"))


def _text(header="time,a [N]", row=None, at=20):
    rows = [f"{k / 1000},{k}" for k in range(40)]
    if row is not None:
        rows[at] = row
    return "\n".join([header, *rows]) + "\n"


@pytest.mark.parametrize(("text", "options", "message"), [
    (_text(row="0.02,oops"), {}, r"row 22, column a \[N\]: not a number: 'oops'"),
    (_text(row="0.019,3"), {}, r"row 22, column time: times do not ascend: 0\.019; expected more than 0\.019 s"),
    (_text(row=",3"), {}, "row 22, column time: a time is missing"),
    (_text(row="0.02,3,4,5"), {}, None),
    (_text(), {"sample_rate": 990.0}, "declared sample rate is not the file's: '990 Hz'; expected 1000 Hz"),
    (_text(), {"sample_rate": 1000.5}, None),
    (_text(), {"columns": ["b"]}, "column: no such column: 'b'; expected time, a"),
    (_text(), {"time_column": "clock"}, "time column: no such column: 'clock'"),
    (_text("time,a [stone]"), {}, r"a \[stone\]: no unit of a sensor"),
    (_text("time,a [what?]"), {}, r"a \[what\?\]: unknown unit"),
    (_text("time (h),a [N]"), {}, r"time \(h\): unknown unit of time"),
    (_text("time,a"), {}, "a: what was measured is unknown; expected --quantity and --unit"),
    (_text("time,a"), {"quantity": "force"}, None),
    (_text("time,time"), {}, "two columns have the same name"),
    (_text("0,1"), {}, "no header line"),
    ("time,a [N]\n0,1\n", {}, "too few samples"),
    ("", {}, "the table is empty"),
    ("time\n0\n1\n2\n", {}, "no column to import"),
])
def test_tables_that_make_no_sense_are_refused_in_one_line(tmp_path, text, options, message):
    (tmp_path / "cut.csv").write_text(text)
    if message is None:
        assert import_csv(tmp_path / "cut.csv", OP, tmp_path / "cut.mcap", **options).samples == 40
        return
    with pytest.raises(InputError, match=message) as caught:
        import_csv(tmp_path / "cut.csv", OP, tmp_path / "cut.mcap", **options)
    assert str(caught.value).startswith(str(tmp_path / "cut.csv"))
    assert [p.name for p in tmp_path.iterdir()] == ["cut.csv"]


def test_bytes_are_no_table(tmp_path):
    (tmp_path / "cut.csv").write_bytes(b"time,a\n\xff\xfe\x00\n")
    with pytest.raises(InputError, match="not a table of text"):
        import_csv(tmp_path / "cut.csv", OP, tmp_path / "cut.mcap")
    with pytest.raises(InputError, match="cannot read"):
        import_csv(tmp_path / "missing.csv", OP, tmp_path / "cut.mcap")


def test_real_recordings_are_imported(recordings, tmp_path):
    for file in sorted((recordings / "sound").glob("*.wav")):
        samples, rate = soundfile.read(file, dtype="float32", always_2d=True)
        done = import_sound(file, OP, tmp_path / f"{file.stem}.mcap", sample_rate=48_000.0)
        assert done.sample_rate == rate
        assert np.array_equal(_joined(tmp_path / f"{file.stem}.mcap"), samples)
    for file in sorted((recordings / "acceleration").glob("*.csv")):
        done = import_csv(file, OP, tmp_path / f"{file.stem}.mcap")
        assert done.sample_rate == pytest.approx(1650.5, abs=1.0)
        assert done.channels == ("Accel X", "Accel Y", "Accel Z")
        assert np.isfinite(_joined(tmp_path / f"{file.stem}.mcap")).all()

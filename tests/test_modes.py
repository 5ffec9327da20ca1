"""Modes from measured receptances: known ones found again, files in every form, bad files in one line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from turnmill_core.operation_file import read_operation
from turnmill_ros.cli.app import run
from turnmill_ros.errors import InputError
from turnmill_ros.frf_file import FrfFile, read_frfs
from turnmill_ros.modal_fit import fit_modes

F = np.arange(2.0, 1601.0, 2.0)
TRUE = {"xx": [(682.0, 0.0532, 1.303), (800.0, 0.0197, 1.635)], "yy": [(776.0, 0.032, 0.873)],
        "xy": [(326.0, 0.0072, -34.1), (774.0, 0.004, -40.7)]}


def receptance(modes: list[tuple[float, float, float]], f: np.ndarray = F) -> np.ndarray:
    """Sum of 1 / (m (w_n^2 - w^2 + 2 i zeta w_n w))."""
    w = 2 * np.pi * f
    return sum(1 / (m * ((2 * np.pi * fn) ** 2 - w**2 + 2j * zeta * 2 * np.pi * fn * w)) for fn, zeta, m in modes)


def noisy(noise: float, seed: int = 3) -> FrfFile:
    """The true receptances with white noise, relative to the peak."""
    rng = np.random.default_rng(seed)
    clean = np.stack([receptance(modes) for modes in TRUE.values()])
    size = noise * np.abs(clean).max(axis=1, keepdims=True) / np.sqrt(2)
    noise_of = rng.normal(size=clean.shape) + 1j * rng.normal(size=clean.shape)
    return FrfFile(F, tuple(TRUE), clean + size * noise_of, ())


@pytest.mark.parametrize(("noise", "within"), [(0.0, 1e-6), (0.005, 0.05)])
def test_known_modes_are_found(noise: float, within: float) -> None:
    """Number, frequency, damping, mass and sign; a cross receptance may be negative."""
    for fit in fit_modes(noisy(noise), (100.0, 1500.0)):
        assert len(fit.modes) == len(TRUE[fit.pair])
        for mode, (frequency, damping, mass) in zip(fit.modes, TRUE[fit.pair], strict=True):
            assert mode.frequency == pytest.approx(frequency, rel=max(within / 20, 1e-9))
            assert mode.damping == pytest.approx(damping, rel=within)
            assert mode.mass == pytest.approx(mass, rel=within)


def test_what_lies_beyond_the_band_does_not_bend_the_fit() -> None:
    """A mode below and one above are taken up by the remainders."""
    H = receptance([(90.0, 0.02, 8.0), (700.0, 0.03, 1.0), (4000.0, 0.02, 0.1)])
    mode, = fit_modes(FrfFile(F, ("xx",), H[None], ()), (400.0, 1100.0))[0].modes
    assert mode.frequency == pytest.approx(700, rel=1e-4)
    assert mode.damping == pytest.approx(0.03, rel=0.01)
    assert mode.mass == pytest.approx(1.0, rel=0.01)


def test_a_complex_residue_is_seen() -> None:
    """R = exp(i phase) / (2 i w_d m) for one mode."""
    w, zeta, phase = 2 * np.pi * 700.0, 0.03, np.radians(12)
    wd, s = w * np.sqrt(1 - zeta**2), 2j * np.pi * F
    pole, residue = -zeta * w + 1j * wd, np.exp(1j * phase) / (2j * wd)
    H = residue / (s - pole) + np.conj(residue) / (s - np.conj(pole))
    mode, = fit_modes(FrfFile(F, ("xx",), H[None], ()), (300.0, 1200.0), [700.0])[0].modes
    assert mode.phase == pytest.approx(phase, abs=np.radians(1.5))


def write_table(path: Path, unit: str = "um/N", scale: float = 1e6, order: int = 0) -> Path:
    """The true receptances as a table."""
    columns = [F]
    for modes in TRUE.values():
        H = receptance(modes) * (2j * np.pi * F) ** order * scale
        columns += [H.real, H.imag]
    header = ",".join(["frequency [Hz]", *(f"{pair} {part} [{unit}]" for pair in TRUE for part in ("real", "imag"))])
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.12e")
    return path


@pytest.mark.parametrize(("unit", "scale", "order"), [("um/N", 1e6, 0), ("m/s/N", 1.0, 1), ("g/N", 1 / 9.80665, 2)])
def test_every_unit_becomes_a_receptance(tmp_path: Path, unit: str, scale: float, order: int) -> None:
    found = read_frfs(write_table(tmp_path / "frf.csv", unit, scale, order))
    assert found.pairs == ("xx", "yy", "xy")
    np.testing.assert_allclose(found.receptance, np.stack([receptance(m) for m in TRUE.values()]), rtol=1e-6)


def test_magnitude_and_phase(tmp_path: Path) -> None:
    H = receptance(TRUE["xx"])
    np.savetxt(tmp_path / "m.csv", np.column_stack([F, np.abs(H), np.degrees(np.angle(H))]), delimiter=",",
               header="Frequency [Hz],xx magnitude [m/N],xx phase [deg]", comments="", fmt="%.12e")
    np.testing.assert_allclose(read_frfs(tmp_path / "m.csv").receptance[0], H, rtol=1e-6)


def universal(path: Path, sets: list[tuple[int, int, int, int]], quantity: int = 12, order: int = 2) -> Path:
    """A universal file with FRFs of (response node, direction, force node, direction)."""
    import pyuff

    data = []
    for response, rdir, force, fdir in sets:
        pair = "".join(sorted("xyz"[abs(rdir) - 1] + "xyz"[abs(fdir) - 1]))
        H = receptance(TRUE[pair]) * np.sign(rdir) * np.sign(fdir) * (2j * np.pi * F) ** order
        data.append(pyuff.prepare_58(
            binary=0, func_type=4, rsp_node=response, rsp_dir=rdir, ref_node=force, ref_dir=fdir, data=H, x=F,
            ordinate_spec_data_type=quantity, abscissa_spec_data_type=18, orddenom_spec_data_type=13, id1="", id2="",
            id3="", id4="", id5="", load_case_id=0, rsp_ent_name="NONE", ref_ent_name="NONE", ord_data_type=5,
            abscissa_spacing=1, num_pts=F.size, abscissa_min=2.0, abscissa_inc=2.0, z_axis_value=0.0))
    pyuff.UFF(str(path)).write_sets(data, mode="overwrite")
    return path


def test_universal_file(tmp_path: Path) -> None:
    """Accelerances of one struck point; a sensor that looks the other way; xy and yx are one receptance."""
    file = universal(tmp_path / "t.uff", [(1, 1, 1, 1), (1, -2, 1, 2), (1, 1, 1, 2), (1, 2, 1, 1), (2, 1, 1, 1)])
    found = read_frfs(file)
    assert found.pairs == ("xx", "yy", "xy")
    np.testing.assert_allclose(found.receptance, np.stack([receptance(m) for m in TRUE.values()]), rtol=1e-4)
    assert any("differ" in note for note in found.notes)


def test_a_universal_file_with_two_struck_points_asks_which(tmp_path: Path) -> None:
    file = universal(tmp_path / "t.uff", [(1, 1, 1, 1), (2, 1, 2, 1)])
    with pytest.raises(InputError, match="--node"):
        read_frfs(file)
    assert read_frfs(file, 2).pairs == ("xx",)


def test_command_writes_an_operation_that_loads(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = write_table(tmp_path / "tip.csv")
    out, page = tmp_path / "mine.yaml", tmp_path / "fit.html"
    code = run(["modes", str(file), "--operation", "thesis_table_4_10", "--band", "100Hz..1500Hz", "--write", str(out),
                "--report", str(page), "--json"])
    found = json.loads(capsys.readouterr().out)
    assert code == 0
    op = read_operation(out)
    assert [m.frequency for m in op.tool.structure.modes] == pytest.approx([682, 800, 776], rel=1e-5)
    assert [(c.plane, c.mass) for c in op.tool.structure.cross_modes] == [
        ("-xy", pytest.approx(34.1, rel=1e-4)), ("-xy", pytest.approx(40.7, rel=1e-4))]
    assert op.tool.structure.cross_reading == "symmetric"
    assert "tip.csv" in op.sources
    assert found["receptances"][0]["modes"][0]["mass_kg"] == pytest.approx(1.303, rel=1e-5)
    assert "bk-" in page.read_text(encoding="utf-8") or "bokeh" in page.read_text(encoding="utf-8").lower()


@pytest.mark.parametrize(("header", "words"), [
    ("time [s],xx real [m/N],xx imag [m/N]", "frequency [Hz]"), ("frequency [Hz],xx real [m/N]", "half a receptance"),
    ("frequency [Hz],xx real [N],xx imag [N]", "unknown unit"), ("frequency [Hz],a,b", "unknown column"),
    ("frequency [Hz],xx real [m/N],xx imag [um/N]", "two units"),
])
def test_bad_tables_are_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], header: str, words: str,
) -> None:
    file = tmp_path / "bad.csv"
    columns = header.count(",") + 1
    file.write_text(header + "\n" + "\n".join(",".join([str(k + 1)] + ["1e-6"] * (columns - 1)) for k in range(50)),
                    encoding="utf-8")
    assert run(["modes", str(file)]) == 2
    error = capsys.readouterr().err
    assert words in " ".join(error.split())
    assert len(error.strip().splitlines()) == 1


def test_a_receptance_without_a_mode_and_a_wrong_sign(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, H, words in (("flat", np.full(F.size, 1e-8 + 0j), "no mode found"),
                           ("turned", -receptance(TRUE["yy"]), "negative mode")):
        np.savetxt(tmp_path / f"{name}.csv", np.column_stack([F, H.real, H.imag]), delimiter=",",
                   header="frequency [Hz],yy real [m/N],yy imag [m/N]", comments="", fmt="%.12e")
        assert run(["modes", str(tmp_path / f"{name}.csv")]) == 2
        assert words in capsys.readouterr().err

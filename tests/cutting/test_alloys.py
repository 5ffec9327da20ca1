"""Alloy database: laws, sources, ranges, and the coefficients that follow."""

from __future__ import annotations

import math

import pytest

from turnmill_core.cutting.alloys import ALLOYS, Alloy, alloy_material, find_alloy
from turnmill_core.cutting.coefficients import oblique_coefficients, orthogonal_data
from turnmill_core.operation_file import OperationError, parse_operation, shipped_operations

DEG, MM, M_MIN = math.pi / 180, 1e-3, 1 / 60


@pytest.mark.parametrize("alloy", ALLOYS.values(), ids=lambda a: a.name)
def test_every_alloy_has_a_source_and_data_all_over_its_ranges(alloy: Alloy) -> None:
    """Shear stress and angles are physical in every corner, and the chip can shear at any helix angle."""
    assert "(19" in alloy.source or "(20" in alloy.source
    for rake in alloy.rake_angle:
        for chip in alloy.chip_thickness:
            for speed in alloy.cutting_speed:
                data = alloy.data(rake, chip, speed)
                assert 10 * DEG < data.shear_angle < 60 * DEG
                assert 5 * DEG < data.friction_angle < 45 * DEG
                for helix in (0.0, 30 * DEG, 45 * DEG):
                    k = alloy_material(alloy, rake, helix, chip, speed)
                    assert k.Ktc > k.Krc
                    assert k.Kac == pytest.approx(0, abs=1) if helix == 0 else k.Kac > 0


def test_titanium_by_hand() -> None:
    """Rake 0, h = 1 mm would give r_c = C0 = 1.755; at h = 0.1 mm r_c = 1.755 / 10^0.331 and tan(phi) = r_c."""
    data = find_alloy("ti-6al-4v").data(0.0, 0.1 * MM, 30 * M_MIN)
    assert math.tan(data.shear_angle) == pytest.approx(1.755 * 10**-0.331)
    assert data.shear_stress == pytest.approx(613e6)
    assert data.friction_angle == pytest.approx(19.1 * DEG)


def test_aluminium_by_hand_and_beside_a_measured_tool() -> None:
    """Rake 13.5 deg, helix 25 deg: the thesis identified 732, 56, 220 MPa and 22, 23 N/mm on such a tool (4.2.3)."""
    alloy = find_alloy("Al7050-T7451")
    data = alloy.data(10 * DEG, 0.1 * MM, 200 * M_MIN)
    assert data.shear_stress == pytest.approx(307.55e6)
    assert data.shear_angle / DEG == pytest.approx(24.2 + 3.667 + 0.98 + 3.0)
    assert data.friction_angle / DEG == pytest.approx(18.79 + 0.67 - 1.52 + 2.561)
    k = alloy_material(alloy, 13.5 * DEG, 25 * DEG, 0.05 * MM, 200 * M_MIN)
    assert k.Ktc / 1e6 == pytest.approx(732, rel=0.15)
    assert k.Kac / 1e6 == pytest.approx(220, rel=0.15)


def test_coefficients_lead_back_to_the_alloy() -> None:
    alloy = find_alloy("Ti6Al4V")
    data = alloy.data(8 * DEG, 0.05 * MM, 40 * M_MIN)
    k = oblique_coefficients(data, 8 * DEG, 30 * DEG)
    found, flow = orthogonal_data(k, 8 * DEG, 30 * DEG, data.shear_angle)
    assert found.shear_stress == pytest.approx(data.shear_stress, rel=1e-14)
    assert found.friction_angle == pytest.approx(data.friction_angle, rel=1e-14)
    assert flow == pytest.approx(30 * DEG, rel=1e-14)


@pytest.mark.parametrize(("rake", "chip", "speed", "words"), [
    (-5 * DEG, 0.1 * MM, 30 * M_MIN, "rake angle for the data of Ti6Al4V is -5.0 deg, expected 0 to 15 deg"),
    (5 * DEG, 1 * MM, 30 * M_MIN, "chip thickness for the data of Ti6Al4V is 1.0 mm"),
    (5 * DEG, 0.1 * MM, 300 * M_MIN, "cutting speed for the data of Ti6Al4V is 300.0 m/min"),
])
def test_data_are_not_used_outside_their_ranges(rake: float, chip: float, speed: float, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        find_alloy("Ti6Al4V").data(rake, chip, speed)


def _with_material(material: str) -> str:
    lines = shipped_operations()["milling_benchmark_1dof"].read_text(encoding="utf-8").splitlines()
    begin = lines.index("material:")
    end = next(k for k in range(begin + 1, len(lines)) if not lines[k].startswith(" "))
    return "\n".join([*lines[:begin], f"material: {material}", *lines[end:]])


def test_an_operation_may_name_an_alloy() -> None:
    op = parse_operation(_with_material("{alloy: al7050 t7451, rake_angle: 12 deg}"))
    chip = op.feed_per_tooth * 2 / math.pi  # mean of c sin(phi) over full immersion
    speed = op.tool.radius * op.conditions.tool_speed
    expected = alloy_material(find_alloy("Al7050-T7451"), 12 * DEG, 0.0, chip, speed)
    assert op.material == expected
    named = parse_operation(_with_material(
        "{name: plate, alloy: Al7050-T7451, rake_angle: 12 deg, chip_thickness: 0.05 mm}"))
    assert named.material.name == "plate"
    assert named.material.Ktc > expected.Ktc


@pytest.mark.parametrize(("material", "words"), [
    ("{alloy: unobtainium, rake_angle: 5 deg}", "one of Ti6Al4V, Al7050-T7451"),
    ("{alloy: Ti6Al4V}", "rake_angle"),
    ("{alloy: Ti6Al4V, rake_angle: 5 deg, name: t, Ktc: 900 MPa}", "either name, Ktc"),
    ("{name: t, Ktc: 900 MPa, Krc: 300 MPa}", "either name, Ktc, Krc, Kac"),
    ("{alloy: Ti6Al4V, rake_angle: 5 deg}", "cutting speed for the data of Ti6Al4V"),
])
def test_materials_that_cannot_be(material: str, words: str) -> None:
    with pytest.raises(OperationError, match=words):
        parse_operation(_with_material(material))

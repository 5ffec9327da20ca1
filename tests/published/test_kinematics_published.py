"""The thesis' comparison of screw theory with its Denavit-Hartenberg solution, and its limit."""

from __future__ import annotations

from tests.published.rows_kinematics import rows


def test_agreement_to_the_last_digit_inside_the_limit_and_not_outside() -> None:
    inside, outside, links = rows()
    assert inside.published == 2.2e-16
    assert inside.computed <= 2.3e-16  # one unit in the last place of angles between 0.5 and 2
    assert outside.computed > 1e-3
    assert links.computed < 1e-15

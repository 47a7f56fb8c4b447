"""Pictures beside those of runs: responses, contraction, libraries, alignment, between samples."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from ilc_rt import (
    Library,
    ModelInverseIlc,
    PdIlc,
    analyze,
    discretize,
    from_transfer_function,
    pictures,
    second_order,
    simulate,
)
from ilc_rt.identify import FrequencyResponse
from ilc_rt.intersample import error_between_samples
from ilc_rt.pictures.aligned import shift_of
from ilc_rt.pictures.themes import THEMES

if TYPE_CHECKING:
    from pathlib import Path

    from ilc_rt import CampaignResult

DT_S = 0.002
PLANT = second_order(94.0, 0.7)
AXIS = discretize(PLANT, DT_S)
MOTION = 0.01 * np.hanning(150)


def response(model, f):
    return model.frequency_response(2 * np.pi * f)[:, 0, 0]


def test_a_bode_plot_has_measurement_and_model() -> None:
    f = np.linspace(1.0, 100.0, 80)
    # A whole turn of the phase is no difference.
    measured = FrequencyResponse(f, 2.0 * response(AXIS, f), np.linspace(1.0, 0.9, 80), 4)
    panels = Figure().subplots(3, 1)
    drawn = pictures.bode(
        {"measured": measured, "model": AXIS}, uncertainty=(f, np.full(80, 1.4)), ax=panels
    )
    assert drawn == list(panels)
    assert [line.get_label() for line in drawn[0].lines] == ["measured", "model"]
    dots, line = (one.get_ydata() for one in drawn[0].lines)
    np.testing.assert_allclose(dots - line, 20 * np.log10(2.0), atol=1e-9)
    np.testing.assert_allclose(*(one.get_ydata() for one in drawn[1].lines), atol=1e-6)
    assert drawn[2].get_ylim()[1] > 1.4
    assert all("Hz" in axes.get_xlabel() for axes in drawn)


def test_models_alone_are_drawn_to_their_nyquist_frequency() -> None:
    slow = discretize(PLANT, 0.01)
    upper, lower = pictures.bode([AXIS, slow, PLANT])
    tops = [float(line.get_xdata().max()) for line in upper.lines]
    assert tops[1] <= 50.0 < tops[0] <= 250.0
    assert len(lower.lines) == 3
    with pytest.raises(ValueError, match=r"model\[output, input\]"):
        pictures.bode(AXIS.append(AXIS))
    with pytest.raises(ValueError, match="3 axes; 2 are needed"):
        pictures.bode(AXIS, ax=Figure().subplots(3, 1))
    with pytest.raises(ValueError, match="at least one"):
        pictures.bode({})


def test_a_contraction_is_that_of_the_equation_and_marks_where_it_is_1() -> None:
    """``|1 - L P|`` of a P-type law, which looks one sample ahead."""
    found = analyze(PdIlc(kp=0.5), AXIS, 200)
    axes = pictures.contraction({"P": found})
    f, factor = axes.lines[1].get_data()
    expected = np.abs(1 - 0.5 * np.exp(2j * np.pi * f * DT_S) * response(AXIS, f))
    np.testing.assert_allclose(factor, expected, rtol=1e-3, atol=1e-3)
    critical = axes.lines[2].get_xdata()[0]
    assert critical == found.critical_frequency_hz
    assert np.interp(critical, f, factor) == pytest.approx(1.0, abs=0.02)
    assert "critical" in axes.get_legend().get_texts()[0].get_text()
    with pytest.raises(TypeError, match="Analysis is needed"):
        pictures.contraction([1.0])


def test_a_library_is_drawn_over_its_disturbance(tmp_path: Path) -> None:
    library = Library(tmp_path / "l.db")
    for number, at in enumerate((20.0, 30.0, 25.0)):
        error = np.full(4, 1e-6 * (number + 1))
        library.append(np.zeros(4), error, 0.01, disturbance=at, campaign=f"day {number // 2}")
    library.append(np.zeros(4), np.ones(4), 0.01, campaign="without")
    axes = pictures.library_map(tmp_path / "l.db", xlabel="temperature in °C")
    points = {line.get_label(): line.get_data() for line in axes.lines}
    assert set(points) == {"day 0", "day 1"}
    np.testing.assert_allclose(points["day 0"], [[20.0, 30.0], [1.0, 2.0]])
    np.testing.assert_allclose(points["day 1"], [[25.0], [3.0]])
    assert axes.get_ylabel() == "tracking rms in µm"
    assert axes.get_title(loc="left").startswith("1 more runs")
    two = pictures.library_map({"a": tmp_path / "l.db", "b": tmp_path / "l.db"})
    assert [line.get_label() for line in two.lines] == ["a", "b"]
    with pytest.raises(ValueError, match="no run has disturbance 1"):
        pictures.library_map(tmp_path / "l.db", disturbance=1)


def test_runs_of_different_campaigns_lie_on_each_other() -> None:
    """A campaign that waits 24 ms longer, and one that samples half as often."""
    first = simulate(AXIS, PdIlc(kp=0.4), MOTION)
    late = simulate(AXIS, PdIlc(kp=0.4), np.concatenate((np.zeros(12), MOTION)))
    axes = pictures.overlay({"first": first, "late": late})
    (_, own), (time_s, shifted) = (line.get_data() for line in axes.lines)
    np.testing.assert_allclose(time_s[12:], np.arange(150) * DT_S, atol=1e-12)
    # The same error at the same time.
    np.testing.assert_allclose(shifted[12:], own, atol=0.02 * np.abs(own).max())
    shift_s, same = shift_of(MOTION, DT_S, np.append(np.zeros(5), MOTION[::2]), 2 * DT_S)
    assert shift_s == pytest.approx(-10 * DT_S, abs=1.1 * DT_S)
    assert same > 0.98
    back = simulate(AXIS, None, np.concatenate((MOTION, -MOTION, MOTION)), trials=1)
    with pytest.raises(ValueError, match="another motion than that of first"):
        pictures.overlay({"first": first, "back": back})
    still = simulate(AXIS, None, np.zeros(50), trials=1)
    assert pictures.overlay([still, still]).lines[1].get_label() == "none 2"


def test_an_inverse_rings_between_the_samples_and_is_seen() -> None:
    """A plant of third order, sampled fast: its sampling zero near -1 lets the input alternate."""
    plant = from_transfer_function([1.0], [1.0, 20.0, 0.0])
    model = discretize(plant, 0.01)
    reference = np.where(np.arange(80) < 10, 0.0, 1.0)
    result = simulate(model, ModelInverseIlc(model, 80, gain=1.0), reference, trials=2)
    time_s, error = error_between_samples(result.records[1], plant, 0.01)
    np.testing.assert_allclose(error[::16, 0], result.error[1, :, 0], atol=1e-8)
    assert np.abs(result.error[1, 12:]).max() < 1e-8
    assert np.abs(error[time_s > 0.13]).max() > 1e-3
    axes = pictures.between_samples(result, plant)
    assert "between" in axes.get_legend().get_texts()[0].get_text()
    delayed = error_between_samples(result.records[1], plant, 0.01, delay_s=0.02)[1]
    np.testing.assert_allclose(delayed[:32, 0], 0.0, atol=1e-12)
    with pytest.raises(ValueError, match="a continuous-time model is needed"):
        error_between_samples(result.records[1], model, 0.01)


def test_spectra_of_inputs_and_several_runs() -> None:
    result = simulate(AXIS, PdIlc(kp=0.5), MOTION, trials=4)
    axes = pictures.spectrum(result, "input", run=(1, -1))
    assert [line.get_label() for line in axes.lines] == ["run 1", "run 3"]
    assert axes.get_ylabel() == "amplitude of the input in µm"
    # The first run has no input: nothing is drawn, and nothing is divided by 0.
    assert np.isnan(pictures.spectrum(result, "input", run=0).lines[0].get_ydata()).all()


def test_a_contour_is_magnified_by_what_the_title_says(finished: CampaignResult) -> None:
    axes = pictures.contour({"a": finished, "b": finished}, run=0, factor=30)
    assert "shown 30 times" in axes.get_title(loc="left")
    assert [line.get_label() for line in axes.lines] == ["programmed", "a", "b"]
    with pytest.raises(ValueError, match="no contour"):
        pictures.contour(simulate(AXIS, None, MOTION, trials=1))


def contrast(colour: str, ground: str) -> float:
    """Return the contrast ratio of WCAG 2."""
    shares = []
    for one in (colour, ground):
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in to_rgb(one)]
        shares.append(0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2])
    return (max(shares) + 0.05) / (min(shares) + 0.05)


@pytest.mark.parametrize("name", THEMES)
def test_ink_can_be_read_on_its_ground(name: str) -> None:
    """Texts at 4.5 to 1, lines at 3 to 1, as drawn."""
    with pictures.theme(name) as colours:
        axes = pictures.errors([simulate(AXIS, PdIlc(kp=0.1 * k), MOTION) for k in range(1, 8)])
    figure = axes.figure
    figure.canvas.draw()
    assert to_rgb(figure.get_facecolor()) == to_rgb(axes.get_facecolor()) == to_rgb(colours.ground)
    texts = [axes.xaxis.label, axes.yaxis.label, *axes.get_xticklabels(), *axes.get_yticklabels()]
    for text in [*texts, *axes.get_legend().get_texts()]:
        assert contrast(text.get_color(), colours.ground) >= 4.5
    drawn = {line.get_color() for line in axes.lines}
    assert len(drawn) == 7
    assert min(contrast(colour, colours.ground) for colour in drawn) >= 3.0


def test_a_theme_holds_within_its_block_alone() -> None:
    result = simulate(AXIS, PdIlc(kp=0.5), MOTION, trials=2)
    before = pictures.errors(result).figure.get_facecolor()
    with pictures.theme("dark"):
        assert pictures.errors(result).figure.get_facecolor() != before
    assert pictures.errors(result).figure.get_facecolor() == before
    with pytest.raises(ValueError, match="'light', 'dark'"), pictures.theme("sepia"):
        pass

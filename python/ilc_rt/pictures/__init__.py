"""Pictures of one result or several: each draws into given axes, and returns them.

A result is a `TrialResult` or a `CampaignResult`; several are a list, or a dict by their labels.
Without `ax` a picture makes a figure of its own: ``pictures.errors(result).figure.savefig(...)``.
The pages of a report (`ilc_rt.plots`) are put together from these.
"""

from ilc_rt.pictures.aligned import overlay
from ilc_rt.pictures.between import between_samples
from ilc_rt.pictures.libraries import library_map
from ilc_rt.pictures.maps import robustness
from ilc_rt.pictures.paths import contour
from ilc_rt.pictures.responses import bode, contraction
from ilc_rt.pictures.runs import errors, signal, spectrum, tracking
from ilc_rt.pictures.themes import Theme, theme
from ilc_rt.pictures.timing import latency

__all__ = [
    "Theme",
    "between_samples",
    "bode",
    "contour",
    "contraction",
    "errors",
    "latency",
    "library_map",
    "overlay",
    "robustness",
    "signal",
    "spectrum",
    "theme",
    "tracking",
]

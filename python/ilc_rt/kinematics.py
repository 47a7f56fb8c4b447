"""Mechanisms between the drives and the tool: gantry and delta."""

from ilc_rt._native import Delta, Gantry, KinematicsError

__all__ = ["Delta", "Gantry", "KinematicsError"]

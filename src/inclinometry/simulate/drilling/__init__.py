"""A tool that drills: what its sensors read, and beside it the truth. Synthetic: no public record has a reference."""

from inclinometry.simulate.drilling.run import DrillingSimulation, DrillingTruth, drilling_blocks, simulate_drilling
from inclinometry.simulate.drilling.scenario import SCENARIOS, Scenario

__all__ = ["SCENARIOS", "DrillingSimulation", "DrillingTruth", "Scenario", "drilling_blocks", "simulate_drilling"]

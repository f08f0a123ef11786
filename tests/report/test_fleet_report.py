"""The page of a fleet: what it says and that it is whole."""

import numpy as np
import pytest

from inclinometry.calibration.drift_alarm import CAUSES
from inclinometry.calibration.drift_status import fleet_status
from inclinometry.report.fleet import fleet_report
from inclinometry.simulate.fleet import FleetScene, simulate_fleet


@pytest.mark.long
def test_page_names_the_due_the_alarm_and_the_rigs():
    scene = FleetScene(
        9, 1e-8 * np.eye(24), calibrations=5, rigs=2, jumps={(2, 4): 0.02 * CAUSES["magnetometer y offset"]}
    )
    status = fleet_status(simulate_fleet(scene, seed=1).histories, reproducibility=False, own_drift=False, iterations=5)
    page = fleet_report(status)
    assert "ALARM" in page
    assert "magnetometer y offset" in page
    assert "full calibration" in page
    assert "A jump of 100 nT would not be seen" in page
    assert "rig 1" in page
    assert page.count("<svg") == 2 + 6
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert all(tool.history.serial in page for tool in status.tools)

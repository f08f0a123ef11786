"""What a run in the hole says of the tool itself, apart from what was known of it before: evidence for its history.

A multi-station analysis minimises r'V^-1 r + x'P^-1 x over the sensors' parameters and its nuisances, the interference
of the assembly and the corrections of the reference. Taken away is the prior of the parameters, kept that of the
nuisances, which are then marginalised:

    J = L_tt - L_tn (L_nn + P_n^-1)^-1 L_nt,   z likewise

with L the information of the stations alone, z their score. J has the rank of what invariants of the fields can show:
a turn of both triads together and the axial bias of the magnetometers, which no one tells from interference, are not
in it.
"""

from __future__ import annotations

import numpy as np

from inclinometry.arrays import Array
from inclinometry.constants import VECTORS
from inclinometry.errors import refused
from inclinometry.findings import Value
from inclinometry.history import PARAMETERS, UNSEEN
from inclinometry.sensors import Tool
from inclinometry.survey.multistation_priors import priors_from_tool
from inclinometry.survey.reduce import SensorCorrection
from inclinometry.uncertainty import chi_square_limit


def run_evidence(correction: SensorCorrection, calibration: Tool) -> tuple[Array, Array]:
    """Parameters (24,) of a tool in a run, relative to its `calibration`, and covariance, by multi-station analysis.

    Of what the stations show; along what they do not, the calibration within 10 % of the field (`history.UNSEEN`), as
    for a check of few positions. The calibration's own covariance is not in them: nothing counts twice. They hold where
    the errors of the reference and the interference are as large as was stated.
    """
    if any(calibration.triads[kind].degree for kind in VECTORS if kind in calibration.triads):
        why: dict[str, Value] = {"reason": "it depends on temperature, which a run does not show"}
        why |= {"tool": calibration.name, "advice": "Calibrate it again instead"}
        raise refused("survey-calibration", why)
    priors = priors_from_tool(calibration)
    names = tuple(correction.parameters)
    size = len(PARAMETERS)
    if names[:-3] != priors.names or correction.priors != priors.source or not correction.score.size:
        raise refused("survey-evidence-priors", {"priors": correction.priors, "needed": priors.source})
    known = priors.covariance[:size, :size]
    scale = np.sqrt(np.diagonal(known))
    if not scale.all() or np.linalg.eigvalsh(known / np.outer(scale, scale))[0] < 1e-12:
        why = {"reason": "it has no full covariance", "advice": "Calibrate with the joint method"}
        raise refused("survey-calibration", why | {"tool": calibration.name})
    root = scale[:, None] * np.linalg.cholesky(known / np.outer(scale, scale))
    back = np.eye(len(names))
    back[:size, :size] = root
    # a drifted tool must not pass for interference across: of the nuisances only the axial one has the run's size
    before = np.array([p.prior for p in correction.parameters.values()])
    before[size : size + 2] = np.sqrt(np.diagonal(priors.covariance))[size : size + 2]
    back[size:, size:] = np.diag(before[size:])
    whole, score = back.T @ correction.information @ back, back.T @ correction.score
    # the nuisances keep their priors, the parameters do not
    nuisance = whole[size:, size:] + np.eye(len(names) - size)
    across = np.linalg.solve(nuisance, np.column_stack([whole[size:, :size], score[size:]]))
    seen = whole[:size, :size] - whole[:size, size:] @ across[:, :size]
    shown = score[:size] - whole[:size, size:] @ across[:, size]
    values, vectors = np.linalg.eigh((seen + seen.T) / 2.0)
    values = np.maximum(values, 0.0)
    # the fit without the prior, from which a tool that drifted is far away
    shown_at_all = values > 1e-6
    of_each = (vectors.T @ shown)[shown_at_all] ** 2
    pull = np.sum(of_each / (values[shown_at_all] * (1.0 + values[shown_at_all])))
    limit = float(chi_square_limit(0.999, max(correction.freedom - int(shown_at_all.sum()), 1)))
    if correction.chi_square - pull > limit:
        raise refused("survey-chi-square", {"chi_square": float(correction.chi_square - pull), "limit": limit})
    # by the relative parameters: E = N^-1 dN, o = N^-1 dU0
    turn = np.zeros((size, size))
    for place, kind in enumerate(VECTORS):
        block = slice(12 * place, 12 * place + 12)
        turn[block, block] = np.kron(calibration.triads[kind].tensor[0], np.eye(4))
    to_relative = np.linalg.solve(root, turn)
    information = to_relative.T @ (vectors * values) @ vectors.T @ to_relative
    covariance = np.linalg.inv(information + np.eye(size) / UNSEEN**2)
    covariance = (covariance + covariance.T) / 2.0
    return np.asarray(covariance @ (to_relative.T @ shown)), np.asarray(covariance)

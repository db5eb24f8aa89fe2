"""Rows of a modular rig in an irregular sea: they end by their power, and settle as planned."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from modular_rigs import limits_mapping, plant_mapping, rig_mapping, write_campaign

from rig.campaign.files import open_campaign
from rig.campaign.plan import build_plan
from rig.config.problems import ConfigError
from rig.kinds.modular.build import campaign_params
from rig.kinds.modular.campaign import CAMPAIGNS

END: dict[str, Any] = {"precision_percent": 1, "least_s": 41}


def campaign(folder: Path, **timing: Any) -> Any:
    path = write_campaign(
        folder,
        rig_mapping(),
        limits_mapping(),
        plant_mapping(),
        sea={"kind": "jonswap", "hs_m": 0.1, "tp_s": 2.0, "repeat_s": 240},
        matrix={"list": [{"kp_n_s_per_m": -2000, "ki_n_per_m": 0}]},
        timing={"end": END, **timing},
    )
    return open_campaign(CAMPAIGNS, path)


def test_the_loop_has_the_bins_of_the_sea(tmp_path: Path) -> None:
    opened = campaign(tmp_path)
    plan = build_plan(opened)
    found = campaign_params(opened, plan).assessed
    stations = [station.name for station in opened.rig.power_stations]
    assert found.paired == (4000.0, 6, 0.0, 0.01, 0)  # six batches of 8 s are the first above 41 s
    assert stations[found.station] == "dc"
    (row,) = plan.rows
    assert (row.measure, row.least_measure) == (240.0, 48.0)


def test_it_has_no_model_by_which_rows_settle(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as error:
        campaign(tmp_path, settle="measured")
    text = "\n".join(each.text() for each in error.value.problems)
    assert "timing.settle: this kind of rig has no model of its transients in such a sea" in text

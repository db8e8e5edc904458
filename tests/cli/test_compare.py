"""`busplan compare` through the command line: each form, options, refusals."""

import json
from collections.abc import Callable
from typing import Any

Run = Callable[..., Any]
Refused = Callable[..., str]


def test_options_change_the_profile_before_it_is_put_on_other_kinds(run: Run) -> None:
    options = ("--set", "bus.nodes=3", "--period", "2ms", "--set", "bus.speed=S200", "--set", "node.axes=2")
    done = run("compare", "paper-1ms", "--buses", "can", *options, "--format", "json")
    document = json.loads(done.stdout)
    assert document["changes"] == {"bus.nodes": 3, "bus.speed": "S200", "node.axes": 2}
    assert (document["period_us"], document["nodes"], document["axes"]) == (2000, 3, 6)
    assert "bus.speed" in document["buses"][0]["left_out"]
    said = run("compare", "paper-1ms", *options).stdout.splitlines()
    assert said[0] == "With --set bus.nodes=3 and --set bus.speed=S200 and --set node.axes=2."
    assert said[1].startswith("paper-1ms at 2 ms: ")


def test_what_cannot_be_is_refused(refused: Refused) -> None:
    said = refused("compare", "paper-1ms", "--buses", "can,iee1394")
    assert said.startswith("--buses iee1394: no kind of bus; there are ieee1394, ")
    assert said.endswith("did you mean ieee1394?")
    assert "no kind of bus" in refused("compare", "paper-1ms", "--buses", "")
    assert "no such file" in refused("compare", "nowhere")
    assert "--set bus.bit_rate_kbit_s=500" in refused("compare", "paper-1ms", "--set", "bus.bit_rate_kbit_s=500")

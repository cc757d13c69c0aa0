"""[scene] of a swarm: what it takes, what does not go together, and who refuses it."""

import pytest

from flocsim.__main__ import main
from flocsim.ensembles.config.loader import load_any_config, load_config
from flocsim.ensembles.swarms.scene import SwarmScene
from flocsim.errors import ConfigError
from tests.helpers.swarm_study import SWARM, swarm_config, write_swarm_study


def test_a_swarm_is_a_scene_of_its_own(tmp_path):
    config = swarm_config(tmp_path)
    assert isinstance(config.scene, SwarmScene)
    assert (config.scene.number, config.scene.interval) == (12, 0.1)
    every = swarm_config(tmp_path, {"scene": {"every": "auto"}}).scene.interval
    assert every == pytest.approx(0.03)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ("area_fraction", "needs area_fraction or box, found neither"),
        ({"scene": {"box": ["1 mm", "1 mm"]}}, "needs area_fraction or box, found both"),
        ({"scene": {"floor": True}}, 'scene.floor = true needs periodic = "x" or "none"'),
        ({"scene": {"leaving": "remove"}}, 'leaving = "remove" needs periodic = "x" or "none"'),
        ({"scene": {"leaving": "fly", "periodic": "x"}}, "leaving"),
        ({"scene": {"min_radius": "6 um"}}, "is not between min_radius and max_radius"),
        ({"scene": {"every": "1 s"}}, "every = 1 s is longer than duration = 0.3 s"),
        ({"scene": {"classes": ["2 um", "1 um"]}}, "classes must be ascending radii"),
        ("radius spread", "needs radius, the median r_eq, or measured"),
        ("radius", "spread needs radius"),
        ({"shapes": {"vertices": [1, 4]}}, "must be one number in a swarm, found [1, 4]"),
        ({"scene": {"types": ["I"]}}, "types"),
        ({"scene": {"kind": "crowd"}}, "kind"),
    ],
)
def test_what_does_not_go_together_is_told(tmp_path, changes, said):
    """``changes``: what is laid over the file, or the keys that it lacks."""
    left_out = tuple(changes.split()) if isinstance(changes, str) else ()
    lines = [line for line in SWARM.splitlines() if not line.startswith(left_out or "#")]
    over = None if left_out else changes
    with pytest.raises(ConfigError) as caught:
        swarm_config(tmp_path, over, "\n".join(lines))
    assert said in str(caught.value)


@pytest.mark.parametrize("table", ["zone", "stop"])
def test_tables_for_pairs_are_refused(tmp_path, table):
    path = write_swarm_study(tmp_path, text=f"{SWARM}[{table}]\n")
    with pytest.raises(ConfigError, match=f"{table}.*is for binary collisions"):
        load_any_config(path)


@pytest.mark.parametrize("command", ["check", "trajectory", "work-precision"])
def test_commands_for_pairs_say_who_runs_it(in_tmp, command, capsys):
    path = write_swarm_study(in_tmp)
    with pytest.raises(ConfigError, match="run it with `flocsim ensemble`"):
        load_config(path)
    assert main([command, str(path)]) == ConfigError.exit_code
    assert "run it with `flocsim ensemble`" in capsys.readouterr().err

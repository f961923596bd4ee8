"""What the supervisor's parameters become."""

import pytest

from chute_ros.ros.supervisor_parameters import PARAMETERS, config_from


@pytest.mark.parametrize("name", ["kill_to_deploy_delay", "low_kill_to_deploy_delay"])
def test_how_long_a_kill_is_waited_for_is_what_was_set(name):
    values = {parameter.name: parameter.default for parameter in PARAMETERS}
    config = config_from({**values, name: 0.35})
    assert getattr(config, name) == 0.35
    assert getattr(config_from(values), name) == values[name]

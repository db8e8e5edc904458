"""What the core may load."""

import subprocess
import sys


def test_parameters_are_checked_without_numpy() -> None:
    program = "import sys, busplan.servo.parameters; print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


def test_plain_python_loads_no_compiled_code() -> None:
    program = (
        "import sys, numpy\n"
        "from busplan.servo import axis, parameters\n"
        "a = parameters.Axis(position_gain_per_s=100.0, max_velocity_mm_s=400.0)\n"
        "t = parameters.LoopTiming(period_us=1000.0)\n"
        "axis.simulate_axis(numpy.zeros(9), axis=a, timing=t, engine='python')\n"
        "print(sys.modules.get('busplan.servo._kernel'))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "None\n"

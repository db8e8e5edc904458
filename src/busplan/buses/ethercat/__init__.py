"""EtherCAT: frames that pass all devices and come back in every cycle, with process data of each device."""

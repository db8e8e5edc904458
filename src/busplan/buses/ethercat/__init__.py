"""EtherCAT: frames that pass all devices and come back, with process data of each device, in every cycle."""

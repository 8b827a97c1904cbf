"""A PLC without hardware: reads the free bit, sees it latched, acknowledges, and sees what a killed process reads as.

    plc.py PORT PROCESS

Waits for the server, follows the alarm through one latched contact and its acknowledgement, kills PROCESS, which serves
Modbus, and prints one line of JSON with what it saw. Package: pymodbus.
"""

import json
import os
import signal
import sys
import time

from pymodbus.client import ModbusTcpClient
from pymodbus.exceptions import ModbusException

PATIENCE_S = 60
BITS = ["free", "contact", "collision", "acknowledged", "muted", "alive"]
ACKNOWLEDGE = 16
HEARTBEAT = 1


class Plc:
    def __init__(self, port):
        self.port = port
        self.client = None

    def read(self):
        """The bits by name; `None` where there is no answer, which is a stop."""
        try:
            if self.client is None:
                self.client = ModbusTcpClient("127.0.0.1", port=self.port, timeout=4, retries=0)
                if not self.client.connect():
                    raise ConnectionError
            answer = self.client.read_discrete_inputs(0, count=len(BITS))
            if answer.isError():
                return None
            return dict(zip(BITS, answer.bits))
        except (ModbusException, OSError):
            if self.client is not None:
                self.client.close()
            self.client = None
            return None

    def wait(self, what, wanted):
        end = time.monotonic() + PATIENCE_S
        bits = None
        while time.monotonic() < end:
            bits = self.read()
            if wanted(bits):
                return bits
            time.sleep(0.01)
        raise SystemExit(f"never: {what}; last read {bits}")


def main(port, process):
    plc = Plc(port)
    saw = {}
    plc.wait("free", lambda bits: bits and bits["free"])
    beat = plc.client.read_input_registers(HEARTBEAT, count=1).registers[0]
    plc.wait("a contact", lambda bits: bits and bits["contact"] and not bits["free"])
    saw["heartbeat_counts"] = plc.client.read_input_registers(HEARTBEAT, count=1).registers[0] != beat
    bits = plc.wait("its end", lambda bits: bits and not bits["contact"])
    saw["latched"] = bits["collision"] and not bits["free"]
    # The pipeline's session may still be on its way here.
    for _ in range(20):
        answer = plc.client.write_coil(ACKNOWLEDGE, True)
        if not answer.isError():
            break
    saw["acknowledged"] = not answer.isError()
    plc.wait("free again", lambda bits: bits and bits["free"])
    saw["free_after"] = True
    os.kill(process, signal.SIGKILL)
    plc.wait("no connection", lambda bits: bits is None)
    saw["no_connection"] = True
    bits = plc.wait("the next life", lambda bits: bits is not None and bits["alive"])
    saw["stop_after_restart"] = bits["collision"] and not bits["free"]
    print(json.dumps(saw), flush=True)


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:]))

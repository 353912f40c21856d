"""A pymodbus server with fixed registers, for our client: pymodbus_server.py tcp PORT | rtu PATH. Prints "ready".

Holding registers 0–99 are 1000 + address, input registers 2000 + address, coils 3, 6, 9 … and discrete inputs 2, 4, 6 … are
set; 20–21 hold 100.5 as a float with its words swapped. `dump FILE` is written when a holding register 99 is written to.
"""
import struct
import sys

from pymodbus.datastore import ModbusSequentialDataBlock, ModbusServerContext, ModbusSlaveContext
from pymodbus.server import StartSerialServer, StartTcpServer


class Watched(ModbusSequentialDataBlock):
    """Prints what is written, so that a test can see it."""

    def setValues(self, address, values):  # noqa: N802 (pymodbus's name)
        super().setValues(address, values)
        print(f"write {address} {' '.join(str(int(v)) for v in values)}", flush=True)


def context():
    holding = [1000 + i for i in range(100)]
    high, low = struct.unpack(">HH", struct.pack(">f", 100.5))
    holding[20:22] = [low, high]
    return ModbusServerContext(single=True, slaves=ModbusSlaveContext(
        hr=Watched(0, holding), ir=ModbusSequentialDataBlock(0, [2000 + i for i in range(100)]),
        co=Watched(0, [i % 3 == 0 for i in range(100)]), di=ModbusSequentialDataBlock(0, [i % 2 == 0 for i in range(100)]),
        zero_mode=True))


def main():
    print("ready", flush=True)
    if sys.argv[1] == "tcp":
        StartTcpServer(context=context(), address=("127.0.0.1", int(sys.argv[2])))
    else:
        StartSerialServer(context=context(), port=sys.argv[2], baudrate=115200, parity="N", timeout=0.01)


if __name__ == "__main__":
    main()

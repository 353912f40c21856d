"""tactus against its peers, in one run; the table goes to standard output and to the file named on the command line."""

import os
import subprocess
import sys

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"  # numpy and we: one thread each

# pylint: disable=wrong-import-position
import numpy
import pandas
import scipy

import bench_diagnose
import bench_fit
import bench_memory
import bench_modbus
import bench_stream
import bench_usb
import harness

PARTS = {"convert": bench_stream.convert, "readout": bench_memory.readout, "lockin": bench_memory.lockin,
         "network": bench_fit.network, "curve": bench_fit.curve, "rows": bench_stream.rows,
         "diagnose": bench_diagnose.diagnose, "modbus": bench_modbus.modbus,
         "usb": bench_usb.usb}


def main():
    path, wanted = sys.argv[1], sys.argv[2:] or PARTS
    miller = subprocess.run(["mlr", "--version"], capture_output=True, text=True, check=True).stdout.split()[-1]
    versions = (f"numpy {numpy.__version__}, scipy {scipy.__version__}, pandas {pandas.__version__}, "
                f"Python {sys.version.split()[0]}, Miller {miller}")
    table = harness.Table()
    print(f"{harness.machine()}\n{versions}")
    for name in wanted:
        PARTS[name](table)
    table.write(path, versions)
    missed = table.missed()
    print("\n" + (f"missed: {'; '.join(missed)}" if missed else "every target met"))


main()

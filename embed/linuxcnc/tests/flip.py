#!/usr/bin/python3
"""Flips a bit of the table of the pkmcompensator that was started from this folder, the last of the bytes given as hex digits: for
the tests alone."""

import glob
import os
import sys

wanted = bytes.fromhex(sys.argv[1])
flipped = 0
for process in glob.glob("/proc/[0-9]*"):
    try:
        if os.readlink(process + "/cwd") != os.getcwd():
            continue
        with open(process + "/maps") as maps:
            regions = [line.split()[0] for line in maps if "pkmcompensator.so" in line and line.split()[1][0] == "r"]
    except OSError:
        continue
    for region in regions:
        begin, end = (int(place, 16) for place in region.split("-"))
        with open(process + "/mem", "r+b", buffering=0) as memory:
            memory.seek(begin)
            at = memory.read(end - begin).find(wanted)
            if at >= 0:
                memory.seek(begin + at + len(wanted) - 1)
                memory.write(bytes([wanted[-1] ^ 1]))
                flipped += 1
sys.exit(flipped != 1)

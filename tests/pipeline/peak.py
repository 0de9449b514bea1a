"""Runs a command, and prints the largest resident memory of it and of all that it started, sampled from /proc.

peak.py COMMAND...
"""

import os
import subprocess
import sys
import time

PAGE = os.sysconf("SC_PAGE_SIZE")
# From the command to the processes of its processes.
DEPTH = 3


def processes():
    """Parent and resident bytes of each process."""
    found = {}
    for name in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{name}/stat") as stat:
                fields = stat.read().rsplit(")", 1)[1].split()
        except OSError:
            continue
        found[int(name)] = (int(fields[1]), int(fields[21]) * PAGE)
    return found


def main():
    command, most = subprocess.Popen(sys.argv[1:]), 0
    while command.poll() is None:
        found, mine = processes(), {command.pid}
        for _ in range(DEPTH):
            mine |= {pid for pid, (parent, _) in found.items() if parent in mine}
        most = max(most, sum(found[pid][1] for pid in mine if pid in found))
        time.sleep(0.004)
    print(f"exit status {command.returncode}, at most {most / 2**30:.2f} GiB")


main()

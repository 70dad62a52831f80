#!/usr/bin/python3
"""Drives a simulated machine as an operator would, in place of a display: for the tests alone. What is to be done is in
drive.json, what came of it goes to verdict.json."""

import json
import subprocess
import sys
import time
import traceback

import linuxcnc

wish = json.load(open("drive.json"))
command, status, channel = linuxcnc.command(), linuxcnc.stat(), linuxcnc.error_channel()
verdict = {"steps": [], "messages": []}


def poll():
    status.poll()
    while message := channel.poll():
        verdict["messages"].append(message[1])
    return status


def until(what, holds, seconds=60):
    end = time.monotonic() + seconds
    while not holds(poll()):
        if time.monotonic() > end:
            raise TimeoutError(f"{what}: not within {seconds} s; messages {verdict['messages']}")
        time.sleep(0.01)


def idle(s):
    return s.interp_state == linuxcnc.INTERP_IDLE and s.inpos and not s.queue


def done(step, **found):
    """What a step leaves: where the machine is, and the messages since the last."""
    time.sleep(0.1)
    poll()
    verdict["steps"].append(
        {"step": step, "on": status.task_state == linuxcnc.STATE_ON, "axes": list(status.position[:5]),
         "joints": list(status.joint_position[:5]), "messages": verdict["messages"], **found})
    verdict["messages"] = []


def periods():
    return int(subprocess.check_output(["halcmd", "getp", "pkmrecord.rows"]), 0)


def mode(which):
    command.mode(which)
    command.wait_complete()


def turn_on():
    command.state(linuxcnc.STATE_ESTOP_RESET)
    command.wait_complete()
    command.state(linuxcnc.STATE_ON)
    until("machine on", lambda s: s.task_state == linuxcnc.STATE_ON)


def mdi(text, seconds=60):
    mode(linuxcnc.MODE_MDI)
    command.mdi(text)
    command.wait_complete(seconds)
    until(text, lambda s: idle(s) or s.task_state != linuxcnc.STATE_ON, seconds)


def go(place):
    mdi("G0 " + " ".join(f"{letter}{value:.6f}" for letter, value in zip("XYZAB", place)))


def run():
    turn_on()
    mode(linuxcnc.MODE_MANUAL)
    command.home(-1)
    until("homed", lambda s: all(s.homed[:5]) and s.inpos)
    # behind homing the controller changes to its axes on its own
    time.sleep(0.3)
    done("home")

    for place in wish["places"]:
        go(place)
        done("place")

    for number, load in enumerate(wish["load"]):
        mdi(f"M68 E{number} Q{load}")
    time.sleep(0.3)
    done("load")
    for number in range(6):
        mdi(f"M68 E{number} Q0")
    time.sleep(0.3)
    done("unload")

    for refused in ["unreachable", "singular"]:
        go(wish[refused])
        done(refused)

    go(wish["home"])
    done("before")
    go(wish["through"])
    done("through")
    turn_on()
    go(wish["home"])
    done("after")

    go(wish["places"][0])
    mode(linuxcnc.MODE_AUTO)
    command.program_open(wish["program"])
    began = time.monotonic()
    command.auto(linuxcnc.AUTO_RUN, 0)
    until("program begun", lambda s: s.interp_state != linuxcnc.INTERP_IDLE)
    until("program", lambda s: idle(s) or s.task_state != linuxcnc.STATE_ON, 300)
    done("program", seconds=time.monotonic() - began)

    # as often as it fits into the periods that are asked for, and then at rest
    while periods() + 30_000 < wish["periods"]:
        mode(linuxcnc.MODE_AUTO)
        command.auto(linuxcnc.AUTO_RUN, 0)
        until("program begun again", lambda s: s.interp_state != linuxcnc.INTERP_IDLE)
        until("program again", lambda s: idle(s) or s.task_state != linuxcnc.STATE_ON, 300)
        done("again")
    until("periods", lambda s: periods() >= wish["periods"], 300)


try:
    run()
    verdict["finished"] = True
except Exception:
    verdict["finished"] = False
    verdict["why"] = traceback.format_exc()
with open("verdict.json", "w") as file:
    json.dump(verdict, file, indent=1)
sys.exit(0)

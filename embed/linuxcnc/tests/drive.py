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


def begun():
    """Where a step's rows begin: with the last that is there. What the step does may be in the next, which a late thread has yet to run."""
    return [periods() - 1]


def run_for(seconds):
    """So long by the servo thread's periods of 1 ms: on a busy computer they come late, and what settles in 0.4 s has not yet."""
    end = periods() + round(1000 * seconds)
    until(f"{seconds} s of periods", lambda s: periods() >= end)


def halcmd(*words):
    return subprocess.check_output(["halcmd", *map(str, words)], text=True).strip()


def mode(which):
    command.mode(which)
    command.wait_complete()


def turn_on():
    """Again, where the first command came too soon after a fault."""
    for _ in range(10):
        command.state(linuxcnc.STATE_ESTOP_RESET)
        command.wait_complete()
        command.state(linuxcnc.STATE_ON)
        command.wait_complete()
        if poll().task_state == linuxcnc.STATE_ON:
            return
        time.sleep(0.5)
    raise TimeoutError(f"machine on: ten times in vain; messages {verdict['messages']}")


def mdi(text, seconds=60):
    mode(linuxcnc.MODE_MDI)
    command.mdi(text)
    command.wait_complete(seconds)
    until(text, lambda s: idle(s) or s.task_state != linuxcnc.STATE_ON, seconds)


def load(on):
    for number, value in enumerate(wish["load"]):
        mdi(f"M68 E{number} Q{value if on else 0}")


def settings(phase, pins):
    """The compensation takes up settings while it is at rest, all of a phase at once; the recorder keeps which."""
    command.state(linuxcnc.STATE_OFF)
    until("at rest", lambda s: halcmd("getp", "pkmcompensator.active") == "FALSE")
    for pin, value in pins.items():
        halcmd("setp", f"pkmcompensator.{pin}", value)
    halcmd("setp", "pkmrecord.whole-5", phase)
    run_for(0.05)
    turn_on()


def lying(step, lie, pin="lie.in1"):
    """A sensor that says something else for a while."""
    rows = begun()
    halcmd("setp", pin, lie)
    run_for(0.4)
    rows.append(periods())
    halcmd("setp", pin, 0)
    run_for(0.4)
    done(step, rows=rows + [periods()])


def skipped():
    """The thread stands still while the force turns round: the next period comes much too late."""
    rows = begun()
    halcmd("stop")
    halcmd("setp", "lie.in1", -2 * wish["load"][2])
    stood = periods()
    time.sleep(0.2)
    skips = periods() == stood
    halcmd("start")
    run_for(0.4)
    rows.append(periods())
    halcmd("setp", "lie.in1", 0)
    run_for(0.4)
    done("skipped", rows=rows + [periods()], skips=skips)


def away(step, place):
    """To a place and back."""
    rows = begun()
    go(place)
    run_for(0.4)
    rows.append(periods())
    go(wish["home"])
    run_for(0.4)
    done(step, rows=rows + [periods()])


def loaded(step, seconds):
    """A load that comes, stays and goes."""
    rows = begun()
    load(True)
    run_for(seconds)
    rows.append(periods())
    load(False)
    run_for(0.3)
    done(step, rows=rows + [periods()])


def joint_mode():
    mode(linuxcnc.MODE_MANUAL)
    command.teleop_enable(0)
    command.wait_complete()
    until("joint mode", lambda s: s.motion_mode == linuxcnc.TRAJ_MODE_FREE)


def faults():
    load(True)
    run_for(0.3)
    lying("nan", "nan")
    lying("spike", 1e6)
    lying("reversed", -2 * wish["load"][2])
    skipped()
    lying("temperature", "nan", "warm.in1")
    lying("jump", 60, "warm-2.in1")
    away("outside", wish["outside"])
    load(False)
    settings(2, {"max-screw-mm": wish["small_screw_mm"]})
    loaded("small", 0.5)
    settings(1, {"max-screw-mm": 0.5, "stuck-s": wish["stuck_s"]})
    loaded("stuck", 1.2)
    settings(0, {"stuck-s": 0})


def abort_and_home_again():
    mode(linuxcnc.MODE_AUTO)
    command.program_open("abort.ngc")
    command.auto(linuxcnc.AUTO_RUN, 0)
    until("program begun", lambda s: s.interp_state != linuxcnc.INTERP_IDLE)
    until("compensated", lambda s: halcmd("getp", "pkmcompensator.active") == "TRUE")
    run_for(1)
    rows = begun()
    command.abort()
    until("aborted", idle)
    until("no load", lambda s: float(halcmd("getp", "motion.analog-out-02")) == 0)
    run_for(0.5)
    done("abort", rows=rows + [periods()])
    load(True)
    go(wish["home"])
    joint_mode()
    rows = begun()
    command.home(-1)
    run_for(0.5)
    until("homed again", lambda s: all(s.homed[:5]) and s.inpos)
    run_for(0.5)
    done("rehome", rows=rows + [periods()])
    load(False)


def park_and_drive_out():
    joint_mode()
    poll()
    for joint in (3, 4):
        way = wish["parked"][joint] - status.joint_position[joint]
        if way:
            command.jog(linuxcnc.JOG_INCREMENT, True, joint, 20.0 if way > 0 else -20.0, abs(way))
    until("parked", lambda s: s.inpos and all(abs(s.joint_position[i] - wish["parked"][i]) < 1e-3 for i in range(5)))
    done("park")
    go(wish["inward"])
    done("inward")
    rows = begun()
    halcmd("setp", "sag.in1", -0.01)
    run_for(0.4)
    rows.append(periods())
    halcmd("setp", "sag.in1", 0)
    run_for(0.1)
    done("sag", rows=rows)
    go(wish["home"])
    done("out")


def to(place):
    return " ".join(f"{letter}{value:.6f}" for letter, value in zip("XYZAB", place))


def go(place):
    mdi("G0 " + to(place))


def go_after_a_fault(place):
    """Again, where the first command came too soon after the machine was on: LinuxCNC then neither moves nor says anything."""
    for _ in range(10):
        stood = poll().position[:5]
        go(place)
        if poll().position[:5] != stood or verdict["messages"]:
            return
        time.sleep(0.5)


def run_program(step, program):
    mode(linuxcnc.MODE_AUTO)
    command.program_open(program)
    began = time.monotonic()
    command.auto(linuxcnc.AUTO_RUN, 0)
    until(f"{step} begun", lambda s: s.interp_state != linuxcnc.INTERP_IDLE)
    until(step, lambda s: idle(s) or s.task_state != linuxcnc.STATE_ON, 300)
    done(step, seconds=time.monotonic() - began)


def feed():
    """A way that is too fast for a screw: as it is programmed, and with the share of the feed that the joints allow."""
    limit = wish["slow_screw_mm_per_s"]
    for screw in range(3):
        halcmd("setp", f"pkmfeed.max-velocity-{screw}", limit)
    halcmd("setp", "pkmfeed.feed-override", 1)
    run_for(0.1)
    rows = [periods()]
    for acts in (0, 1):
        mdi(f"M52 P{acts}")
        for place in wish["places"] + [wish["home"]]:
            mdi(f"G1 G94 F{wish['feed_mm_per_min']} " + to(place))
            rows.append(periods())
    mdi("M52 P0")
    for screw in range(3):
        halcmd("setp", f"pkmfeed.max-velocity-{screw}", 120)
    halcmd("setp", "pkmfeed.feed-override", 1.2)
    done("feed", rows=rows, slow_screw_mm_per_s=limit)


def run():
    turn_on()
    mode(linuxcnc.MODE_MANUAL)
    command.home(-1)
    until("homed", lambda s: all(s.homed[:5]) and s.inpos)
    # behind homing the controller changes to its axes on its own
    run_for(0.3)
    done("home")

    for place in wish["places"]:
        go(place)
        done("place")

    load(True)
    run_for(0.3)
    done("load")
    load(False)
    run_for(0.3)
    done("unload")

    for refused in ["unreachable", "singular"]:
        go(wish[refused])
        done(refused)

    go(wish["home"])
    done("before")
    go(wish["through"])
    done("through")
    turn_on()
    go_after_a_fault(wish["home"])
    done("after")

    faults()
    abort_and_home_again()
    park_and_drive_out()
    feed()

    go(wish["places"][0])
    run_program("compensated", wish["compensated"])
    run_program("program", wish["program"])

    # as often as it fits into the periods that are asked for, and then at rest
    while periods() + 30_000 < wish["periods"]:
        run_program("again", wish["program"])
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

"""A parallel gripper on an arm, with a skin on each of its two jaws, commanded by a test.

The physics is independent of the estimator: an object is on a table, jaws close on it with a force, an arm
accelerates, the object hangs on the skins' tangential spring and slides if friction does not hold it.
simulated_sensors.py converts the force on each skin to frames on a pty.

Gripper's frame G: z out of the palm, which looks down; x from the left jaw to the right one. Skins: z_S towards the
other jaw, x_S towards the palm.
"""
import math
import os
import random
import subprocess
import threading
import time
import tty

from daemon import BIN, wait_for
from simulated_sensors import SENSORS

G_m_s2 = 9.81
RATE_HZ = 500
SUBSTEPS = 8
MADE_UP_FOR = 25  # frames that are sent late after a delay; a machine without the time for all would fall behind
LIFT_m, SPEED_m_s, ACCELERATION_m_s2 = 0.05, 0.2, 1.5
TABLE_N_m, SKINS_N_m, DAMPING = 50e3, 4000.0, 0.3  # SKINS: both skins together; DAMPING: share of critical damping
CLOSES_N_s, OPENS_N_s = 60.0, 80.0
KINETIC = 0.8  # kinetic over static friction
HUM_m_s2, HUM_Hz = 0.3, 37.0  # vibration of the arm during a motion

GRASP = """[grasp]
gravity_G_m_s2 = [0, 0, 9.81]
friction = 0.7
lift_accelerates_ms = 400  # this arm lifts for 0.38 s: until then it speeds up and slows down
objects = "objects.toml"

[[grasp.jaw]]
sensor = "left"
x_S_in_G = [0, 0, -1]
z_S_in_G = [1, 0, 0]

[[grasp.jaw]]
sensor = "right"
x_S_in_G = [0, 0, -1]
z_S_in_G = [-1, 0, 0]

"""


def calibrate_skin(path):
    """Makes the calibration of one skin, fitted from its labelled rows."""
    skin = SENSORS["skin"]()
    skin.begin("quadratic")
    rows = path.with_suffix(".csv")
    skin.write_labelled(rows)
    subprocess.run([BIN / "tactilectl", "calibrate", "--model", "generic", "--method", "quadratic", "--in", rows, "--out", path],
                   check=True, capture_output=True)


def lift_profile(t_s):
    """Returns height and acceleration of the arm t_s after the begin of the lift."""
    ramp_s = SPEED_m_s / ACCELERATION_m_s2
    whole_s = LIFT_m / SPEED_m_s + ramp_s
    if t_s >= whole_s:
        return LIFT_m, 0.0
    if t_s < ramp_s:
        return ACCELERATION_m_s2 * t_s * t_s / 2, ACCELERATION_m_s2
    if t_s < whole_s - ramp_s:
        return SPEED_m_s * (t_s - ramp_s / 2), 0.0
    return LIFT_m - ACCELERATION_m_s2 * (whole_s - t_s) ** 2 / 2, -ACCELERATION_m_s2


class Robot(threading.Thread):
    """Gripper, arm, object and skins, in real time. Commands return at once, as on a robot.

    Each frame has the time of its measurement, and a busy machine delays frames without a gap between these times: a slip lasts some ms."""

    def __init__(self, folder, seed, method="quadratic"):
        super().__init__(daemon=True)
        self.random = random.Random(seed)
        self.skins = {name: SENSORS["skin"]() for name in ("left", "right")}
        self.lock, self.ended, self.failure = threading.Lock(), threading.Event(), None
        self.master, self.slave, self.sequence = {}, {}, 0
        for name, skin in self.skins.items():
            skin.begin(method)
            skin.noise_random = random.Random(f"{seed} {name}")
            self.master[name], self.slave[name] = os.openpty()
            tty.setraw(self.slave[name])
            os.set_blocking(self.master[name], False)
            (folder / name).symlink_to(os.ttyname(self.slave[name]))
        self.world_s = time.monotonic()
        self.silent = set()         # names of skins whose device sends nothing
        self.damaged = {}           # name of a skin: the share of each force that it still measures, fx fy fz
        self.press_N = self.to_N = 0.0
        self.mass_kg, self.friction = 0.2, 0.8
        self.load_N = 0.0           # sum over both skins, upwards
        self.slid_m = 0.0           # since the grasp
        self.lifts_since_s = None   # None: the arm is at the table's height
        self._fresh_object()

    # ---- commands

    def offer(self, mass_kg):
        """Moves the arm down, open, over another object."""
        with self.lock:
            assert self.press_N == 0, "the jaws hold something"
            self.mass_kg, self.lifts_since_s = mass_kg, None
            self._fresh_object()

    def close(self, force_N):
        with self.lock:
            self.to_N = force_N * self.random.gauss(1, 0.01)

    def lift(self):
        with self.lock:
            self.lifts_since_s = self.world_s

    def open(self):
        with self.lock:
            self.to_N = 0.0

    def live(self, seconds):
        """Returns when the world is so much older."""
        until_s = self.world_s + seconds
        wait_for(lambda: self.world_s > until_s, "the world")

    def is_open(self):
        with self.lock:
            return self.press_N == 0

    # ---- physics

    def _fresh_object(self):
        self.y_m = self.v_m_s = self.slid_m = self.load_N = 0.0
        self.slides = False
        self.share = self.random.gauss(0.5, 0.03)              # share of the left jaw: a grasp is never exactly in
                                                               # the middle
        self.clamp_N = self.random.gauss(0, 0.1)               # force between two jaws that are not exactly aligned
        self.across_N = [self.random.gauss(0, 0.05) for _ in range(2)]

    def _step(self, now_s, dt_s):
        rate = CLOSES_N_s if self.to_N > self.press_N else OPENS_N_s
        self.press_N += max(-rate * dt_s, min(rate * dt_s, self.to_N - self.press_N))
        arm_m = arm_v_m_s = 0.0
        if self.lifts_since_s is not None:
            t_s = now_s - self.lifts_since_s
            arm_m = lift_profile(t_s)[0]
            arm_v_m_s = (lift_profile(t_s + 1e-4)[0] - arm_m) / 1e-4
            if 0 < arm_m < LIFT_m:
                w = 2 * math.pi * HUM_Hz
                arm_m += HUM_m_s2 / w ** 2 * math.sin(w * t_s)
                arm_v_m_s += HUM_m_s2 / w * math.cos(w * t_s)
        damping = 2 * DAMPING * math.sqrt(SKINS_N_m * self.mass_kg)
        self.load_N = SKINS_N_m * (arm_m - self.slid_m - self.y_m) + damping * (arm_v_m_s - self.v_m_s)
        most_N = 2 * self.friction * self.press_N * (KINETIC if self.slides else 1)
        self.slides = abs(self.load_N) > most_N
        if self.slides:  # sliding relaxes the spring permanently
            most_N = 2 * self.friction * self.press_N * KINETIC
            self.slid_m += math.copysign((abs(self.load_N) - most_N) / SKINS_N_m, self.load_N)
            self.load_N = math.copysign(most_N, self.load_N)
        if self.press_N == 0:
            self.load_N = 0.0
            self.slid_m = arm_m - self.y_m
        table_N = max(0.0, -TABLE_N_m * self.y_m - 0.7 * 2 * math.sqrt(TABLE_N_m * self.mass_kg) * self.v_m_s) if self.y_m < 0 else 0.0
        self.v_m_s += ((self.load_N + table_N) / self.mass_kg - G_m_s2) * dt_s
        self.y_m += self.v_m_s * dt_s

    def _wrenches(self):
        """Returns the wrench on each skin, frame S: x_S points up, and the object pulls down."""
        touch = min(1.0, self.press_N / 1.0)
        shares = {"left": self.share, "right": 1 - self.share}
        sides = {"left": 1, "right": -1}
        wrenches = {name: {"fx": -share * self.load_N + touch * sides[name] * self.clamp_N,
                           "fy": touch * self.across_N[name == "right"], "fz": -self.press_N} for name, share in shares.items()}
        for name, parts in self.damaged.items():
            wrenches[name] = {force: part * wrenches[name][force] for force, part in parts.items()}
        return wrenches

    def run(self):
        try:
            while not self.ended.is_set():
                time.sleep(max(0, self.world_s + 1 / RATE_HZ - time.monotonic()))
                for behind in range(int((time.monotonic() - self.world_s) * RATE_HZ), 0, -1):
                    with self.lock:
                        for _ in range(SUBSTEPS):
                            self.world_s += 1 / RATE_HZ / SUBSTEPS
                            self._step(self.world_s, 1 / RATE_HZ / SUBSTEPS)
                        wrenches = self._wrenches()
                    if behind <= MADE_UP_FOR:
                        self._send(wrenches)
        except Exception as failure:  # shown by finish()
            self.failure = failure

    def _send(self, wrenches):
        for name, skin in self.skins.items():
            if name in self.silent:
                continue
            try:
                os.write(self.master[name], skin.frame(self.sequence, skin.read(wrenches[name]), round(self.world_s * 1e6)))
            except BlockingIOError:
                pass  # there is no reader yet
        self.sequence += 1

    def finish(self):
        self.ended.set()
        self.join()
        for name in self.master:
            os.close(self.master[name])
            os.close(self.slave[name])
        if self.failure is not None:
            raise self.failure

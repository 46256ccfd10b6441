"""Reads the segment of a tactiled daemon. It needs Python 3.9 or later on Linux and only the standard library. Copy
this file or put it on PYTHONPATH.

    import tactiled

    with tactiled.open("gripper") as node:
        print("sensors:", *node.sensors)
        for sample in node.follow("left", timeout=1.0):
            if sample.quality == tactiled.BAD:
                print("no value:", *sample.reasons_text)
            else:
                print(sample.sequence, *sample.force_S_N)
    print("nothing new for a second")

Fields, units, frames and signs are those of layout.h. At the end of a daemon this module behaves like reader.h. A
reader costs the daemon nothing, cannot delay it, and survives its death. Each thread needs its own object.

The folder of the segment is found and checked by the rule of folder.h, with the same environment variables.

The file is read with pread() and is not mapped: a program that has mapped a file is killed when the file is
truncated, and Python cannot prevent that. A truncated file reads as a daemon that has stopped.

Memory order. A sample is copied by one system call between two others, of which the first one shows that it is
published and the second one that it was not overwritten meanwhile. The three reads must happen in this order. On x86
this holds, because loads are not reordered with loads. On other processors (ARM, RISC-V) the hardware may reorder
them across the entry into the kernel, which is unlikely and not excluded. Use C or C++ if correctness there must be
guaranteed.
"""
import collections
import errno
import math
import operator
import os
import select
import socket
import stat
import struct
import sys
import time
import warnings

try:
    import numpy
except ImportError:  # arrays are memoryview objects without it
    numpy = None

MAGIC, BYTE_ORDER, MAJOR, MINOR = b"TACTILED", 0x01020304, 1, 10
MAX_SENSORS = MAX_LINKS = 16
MAX_TAXELS = 4096
NAME_SIZE = 32  # including the terminating zero

NO_VALUE, GOOD, UNCERTAIN, BAD = range(4)  # Sample.quality

(NO_DATA_YET, STALE, DISCONNECTED, MISSING_CHANNEL, SATURATED, DISAGREEMENT, OUTSIDE_DOMAIN, UNCALIBRATED, NOT_FINITE,
 DAEMON_STOPPED, TARING, READER_OVERRUN, WRONG_DEVICE, UNKNOWN_UNCERTAINTY, FROZEN, STEPPED, IDLE_BUS, WRONG_RATE,
 DRIFTED, SENSORS_DIFFER, UNPROVED_AGE, ARRIVAL_ONLY, ZERO_UNKNOWN, GLITCHES,
 ZERO_OLD, TOO_QUIET, NOT_REDUNDANT, TEMPERATURE) = (1 << bit for bit in range(28))
REASON_WORDS = (  # from bit 0 on, as tactilectl prints them
    "no-data-yet", "stale", "disconnected", "missing-channel", "saturated", "disagreement", "outside-domain",
    "uncalibrated", "not-finite", "stopped", "taring", "reader-overrun", "wrong-device", "sd-unknown",
    "frozen", "stepped", "idle-bus", "wrong-rate", "drifted", "sensors-differ", "unproved-age", "arrival-only",
    "zero-unknown", "glitches", "zero-old", "too-quiet", "not-redundant", "temperature")
FRESHNESS = ("unknown", "request", "cable", "clock", "sequence", "arrival")  # words for Info.freshness
AGE_UNBOUNDED = 0xFFFFFFFF  # Info.age_bound_us: that or more, or not known

CONTACT, OVERLOAD, LOW_PASS, STEPPED_DOWN, OVER_BUDGET = 1, 2, 4, 8, 16  # Sample.state

TAXEL_MISSING, TAXEL_SATURATED, TAXEL_DEAD, TAXEL_FROZEN, TAXEL_OUTSIDE, TAXEL_DOUBTED = 1, 2, 4, 8, 16, 32  # Array.state

READY, ANY_CONTACT = 1 << 0, 1 << 1  # NodeRecord.status
ANY_TARING, SIMULATED, ANY_STALE, ANY_UNCALIBRATED = 1 << 8, 1 << 9, 1 << 10, 1 << 11
WARNING, FAULT, RT_DEGRADED = 1 << 14, 1 << 15, 1 << 16

(GRIP_OPEN, GRIP_CONTACT, GRIP_GRASPED, GRIP_LIFTING, GRIP_HOLDING, GRIP_SLIPPING, GRIP_LOST) = range(7)  # Grasp.state
GRIP_UNKNOWN = SLIP_UNKNOWN = 0xFFFF
(WEIGHT_NONE, WEIGHT_ESTIMATING, WEIGHT_STABLE, WEIGHT_OVERLOAD, WEIGHT_NOT_OBSERVABLE,
 WEIGHT_TEMPERATURE) = range(6)  # Grasp.weight_state
SLIP_NONE, SLIP_INCIPIENT, SLIP_GROSS = range(3)  # Grasp.slip_state

STARTING, RUNNING, STOPPED, REPLACED = 1, 2, 3, 4  # the header's state

_WORD = 0xFFFFFFFF
_RECORD_OFFSET = 8
_LINK_SIZE = 256
_TRIES = 16
_MIN_GRASP_MS = 20  # the daemon publishes at least each 10 ms
_ATTACH_NS = 10_000_000  # between two searches for a successor
_LOOK_S = 0.02           # the longest sleep, because a daemon that dies wakes no reader
_NAP_S = 0.001
_ASK_NS = 1_000_000_000  # between two requests for events if the daemon refuses or does not answer


class Error(Exception):
    """A segment cannot be read; the text has the reason."""


class _Struct:
    """A struct of layout.h. `fields` is "name:format ..." in the letters of the module struct; "-" is padding."""

    def __init__(self, fields):
        self.fields = [tuple(field.split(":")) for field in fields.split()]
        self.struct = struct.Struct("=" + "".join(code for _, code in self.fields))
        self.size = self.struct.size
        self.names = [name for name, _ in self.fields if name != "-"]
        picks, at = [], 0
        for _, code in self.fields:
            if code[-1] == "x":
                continue
            if len(code) == 1 or code[-1] == "s":
                picks.append(at)
                at += 1
            else:
                picks.append(slice(at, at + int(code[:-1])))
                at += int(code[:-1])
        self._pick = operator.itemgetter(*picks)

    def values(self, data, offset=0):
        return self._pick(self.struct.unpack_from(data, offset))

    def texts(self, data, offset):
        """Returns the same as values(), with char arrays as str."""
        return [v.split(b"\0")[0].decode("utf-8", "surrogateescape") if isinstance(v, bytes) else v
                for v in self.values(data, offset)]


_HEADER = _Struct(
    "magic:8s byte_order:I major:H minor:H header_size:I total_size:I epoch:I pid:I boot_id:40s name:32s version:32s "
    "control:108s watchdog_ms:I n_sensors:I sensor_offset:I sensor_size:I n_links:I link_offset:I link_size:I "
    "calibration_id:I node:5I lateness_offset:I -:84x state:I reloads:I -:120x")
_SENSOR = _Struct(
    "name:32s model:32s method:32s serial:32s link:32s ring:5I stale_ms:I n_channels:I components:I full_scale:6f "
    "budget_us:f first_method:I methods:128s method_us:8f method_error:8f count:32I freshness:I "
    "age_bound_us:I arrays:5I n_taxels:I taxel_components:I taxel_rows:I taxel_columns:I taxel_place_offset:I "
    "undetected_mean:f undetected_worst:f undetected_channel:I undetected_kind:I")
_SENSOR_SIZE_1_0, _SENSOR_SIZE_1_8 = 216, 552
_SAMPLE = _Struct(
    "sequence:Q t_ns:Q t_published_ns:Q epoch:I quality:I reasons:I device_sequence:I missing:I saturated:I "
    "tare_count:I lost:I force_S_N:3d torque_S_Nm:3d sd_force_N:3d sd_torque_Nm:3d raw_force_S_N:3d raw_torque_S_Nm:3d "
    "cop_S_m:2d residual:d rate_Hz:f temperature_C:f state:I peak_N:f")
_PLACED = _Struct(f"sample:{_SAMPLE.size}s cop_sd_m:2f sd_part:36f correlation:15f load:6f alike:f alike_within:f model:I")
_ARRAY = _Struct(
    f"sample:{_SAMPLE.size}s n_out:I n_contact:I peak_taxel:I peak_N:f peak_sd_N:f cop_S_m:3f cop_sd_m:3f area_m2:f area_sd_m2:f "
    "axis_rad:f axis_sd_rad:f -:4x")
_GRASP = _Struct(
    "t_ns:Q t_lift_off_ns:Q state:I weight_state:I grasps:I slips:I slip_mask:I slip_latch:I object_id:I scale_shown:I "
    "weight_kg:d weight_sd_kg:d grip_N:f recommended_grip_N:f friction:f friction_sd:f object_probability:f "
    "reserved_float:f object:32s slip_state:16H slip_count:16H friction_use:16f weight_doubts:I doubtful:I")
_TOOL = _Struct(
    "t_ns:Q t_newest_ns:Q quality:I why:I sensors:I bad:I force_G_N:3d torque_G_Nm:3d sd_force_N:3d sd_torque_Nm:3d "
    "gravity_G_m_s2:3f mass_kg:f sensor_quality:16I sensor_force_G_N:48f sensor_torque_G_Nm:48f sensor_sd_force_N:48f "
    "sensor_sd_torque_Nm:48f")
_NODE = _Struct(
    "sequence:Q t_ns:Q cycles:Q missed_cycles:Q heartbeat:I status:I fault:I warning:I worst_cycle_us:I command:6I "
    f"-:4x count:16Q grasp:{_GRASP.size}s tool:{_TOOL.size}s")
_NODE_SIZE_1_1 = 456
_STATE_OFFSET = struct.calcsize("=" + "".join(code for _, code in _HEADER.fields[:-3]))
_RELOADS_OFFSET = _STATE_OFFSET + 4

Header = collections.namedtuple("Header", _HEADER.names)
SensorInfo = collections.namedtuple("SensorInfo", _SENSOR.names)
NodeRecord = collections.namedtuple("NodeRecord", _NODE.names)
Grasp = collections.namedtuple("Grasp", _GRASP.names)
Tool = collections.namedtuple("Tool", _TOOL.names)  # sensor n: sensor_force_G_N[n] and so on are tuples of three
Command = collections.namedtuple("Command", "acknowledged state result")


# The parts of a standard deviation: struct tactiled_budget. sd_part: six tuples, in the order of
# tactiled_uncertainty.PARTS, the module with the rules for them.
Budget = collections.namedtuple("Budget", _PLACED.names[2:])


class Sample(collections.namedtuple("Sample", [*_SAMPLE.names, "cop_sd_m", "budget"])):
    """One sample of one sensor: the fields of struct tactiled_sample, cop_sd_m and budget, with arrays as tuples. Immutable."""
    __slots__ = ()

    @property
    def reasons_text(self):
        """The reasons for which the sample is not GOOD: a list of words."""
        return [word for bit, word in enumerate(REASON_WORDS) if self.reasons >> bit & 1]

    @property
    def age_ms(self):
        """The time since the frame's last byte was read from the kernel."""
        return (time.monotonic_ns() - self.t_ns) / 1e6


class Array(collections.namedtuple("Array", [*_ARRAY.names, "force_S_N", "state"])):
    """The array of a sensor with taxels: the fields of struct tactiled_array; force_S_N, taxels by components, N; and the state
    of each taxel, 0 or bits TAXEL_... of why it has no force, or a doubtful one. The last two are arrays of numpy, or memoryview objects where it
    is not installed. The sample has the verdict: where it is BAD all numbers are NaN."""
    __slots__ = ()


def _array(record, sample, n_taxels, n_components):
    """The Array of a record whose sample was judged."""
    head = _ARRAY.values(record)
    forces, states = _ARRAY.size, _ARRAY.size + 4 * n_taxels * n_components
    if sample.quality == BAD:
        record = record[:forces] + struct.pack("=f", math.nan) * (n_taxels * n_components) + record[states:]
        head = (*head[:2], 0, 0, *(_NAN3 if isinstance(value, tuple) else math.nan for value in head[4:]))
    view = memoryview(record)
    force, state = view[forces:states], view[states:states + n_taxels]
    if numpy is not None:
        force, state = numpy.frombuffer(force, numpy.float32).reshape(n_taxels, n_components), numpy.frombuffer(state, numpy.uint8)
    else:
        force = force.cast("f", (n_taxels, n_components))
    return Array(sample, *head[1:], force, state)


_NAN3 = (math.nan,) * 3


_COP_SD = struct.Struct("=2f")
_COP_SD_OF_ARRAY = _SAMPLE.size + struct.calcsize("=3I2f3f")


_NO_BUDGET = Budget(((math.nan,) * 6,) * 6, (math.nan,) * 15, (math.nan,) * 6, math.nan, math.nan, 0)


def _sample(record, cop_sd_at=_SAMPLE.size):
    """The Sample at the begin of a record. A record of a daemon before layout 1.9 ends with it, one of 1.9 with cop_sd_m, and
    that of an array has no budget."""
    has_sd = len(record) >= cop_sd_at + _COP_SD.size
    budget = _NO_BUDGET
    if cop_sd_at == _SAMPLE.size and len(record) >= _PLACED.size:
        _, _, parts, *rest = _PLACED.values(record)
        budget = Budget(tuple(parts[i:i + 6] for i in range(0, 36, 6)), *rest)
    return Sample._make((*_SAMPLE.values(record), _COP_SD.unpack_from(record, cop_sd_at) if has_sd else _NAN3[:2], budget))


_NOTHING = _sample(bytes(_SAMPLE.size))
_NO_FORCE = {**{name: _NAN3 for name in _SAMPLE.names if "force" in name or "torque" in name},
             "cop_S_m": _NAN3[:2], "cop_sd_m": _NAN3[:2], "budget": _NO_BUDGET, "residual": math.nan, "quality": BAD, "state": 0}


def _invalidated(sample, reason):
    return sample._replace(reasons=sample.reasons | reason, **_NO_FORCE)


def _forgotten(grasp):
    """The same grasp as "not known", so that an old one is not used as a new one. Counters and latched values are
    kept."""
    return grasp._replace(
        state=GRIP_UNKNOWN, weight_state=WEIGHT_NONE, slip_mask=0, object_id=0, object="", weight_doubts=0, doubtful=0, weight_kg=math.nan,
        weight_sd_kg=math.nan, grip_N=math.nan, recommended_grip_N=math.nan, friction=math.nan, friction_sd=math.nan,
        object_probability=math.nan, slip_state=(SLIP_UNKNOWN,) * 16, friction_use=(math.nan,) * 16)


def _tool(data):
    tool = Tool._make(_TOOL.values(data, 0))
    return tool._replace(**{name: tuple(values[i:i + 3] for i in range(0, 48, 3))
                            for name, values in zip(tool._fields, tool) if name.startswith("sensor_") and len(values) == 48})


def _forgotten_tool(tool):
    def bad(quality):
        return quality if quality == NO_VALUE else BAD
    numbers = {name: (_NAN3,) * 16 if name.startswith("sensor_") else _NAN3
               for name in tool._fields if name.endswith(("_N", "_Nm", "_m_s2"))}
    return tool._replace(quality=bad(tool.quality), sensor_quality=tuple(map(bad, tool.sensor_quality)), **numbers)


def _is_fresh(t_ns, now_ns, limit_ms):
    """True if `t_ns` is within the limit. A time in the future is as bad as an old one: this clock then differs from
    the daemon's. The clock is read after the record, so that an interruption makes it older, never younger."""
    return abs(now_ns - t_ns) <= limit_ms * 1_000_000


def _judged(sample, stale_ms, now_ns):
    return sample if _is_fresh(sample.t_ns, now_ns, stale_ms) else _invalidated(sample, STALE)


class _Ring:
    """The functions tactiled_ring_* of layout.h. Records are numbered modulo 2^32."""

    def __init__(self, segment, numbers, size):
        self.offset, self.slot_size, self.slots, self.record_size, self.head_offset = numbers
        self.size, self._known = size, min(size, self.record_size)
        self._read, self._word = segment.read, segment.word

    def fits(self, size):
        return (self.slots >= 8 and self.slots & (self.slots - 1) == 0 and self.slot_size % 128 == 0 and
                self.record_size % 4 == 0 and _RECORD_OFFSET + self.record_size <= self.slot_size and
                self.offset % 128 == 0 and self.offset + self.slots * self.slot_size <= size and
                self.head_offset % 4 == 0 and self.head_offset + 4 <= size)

    def head(self):
        return self._word(self.head_offset)

    def lock_of(self, number):
        return self._word(self.offset + (number & (self.slots - 1)) * self.slot_size)

    def read(self, number):
        """Returns the bytes of a record, or None if the slot has another record or changed during the read. The
        caller has checked before that the record is published: from the head, its lock word, or the node record that
        counts it."""
        slot = self.offset + (number & (self.slots - 1)) * self.slot_size
        whole = (2 * number + 2 & _WORD).to_bytes(4, sys.byteorder)
        data = self._read(slot, _RECORD_OFFSET + self._known)
        if data[:4] != whole or self._read(slot, 4) != whole:
            return None
        return data[_RECORD_OFFSET:] if self._known == self.size else data[_RECORD_OFFSET:].ljust(self.size, b"\0")

    def latest(self):
        for _ in range(_TRIES):
            record = self.read(self.head() - 1)
            if record is not None:
                return record
        return None

    def newest_number(self):
        return max(self.head() - 1, 0)

    def oldest_number(self):
        """Number of the oldest record that will not be overwritten soon."""
        return max(self.head() - (self.slots - 1 - self.slots // 8), 0)


SERVICE_FOLDER, SHARED_FOLDER = "/run/tactiled", "/dev/shm"
_NAME_CHARACTERS = frozenset("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_.-")
_WRITABLE = stat.S_IWGRP | stat.S_IWOTH


def _folders():
    """The folders that are searched for a segment if no folder is given."""
    given, users = os.environ.get("TACTILED_RUNTIME_DIR"), os.environ.get("XDG_RUNTIME_DIR")
    if given:
        return [given]
    return [SERVICE_FOLDER, *([f"{users}/tactiled"] if users else [])]


def _open_folder(path):
    """Returns the descriptor and the owner of a folder that only its owner and root can write to, and for which the
    same holds for each folder above it, but for a sticky folder of root. folder.h has the reasons."""
    names = [name for name in path.split("/") if name]
    if not path.startswith("/") or "." in names or ".." in names:
        raise Error(f'folder "{path:.100}": is not a full path, or has "." or ".." in it')
    flags = getattr(os, "O_PATH", os.O_RDONLY) | os.O_DIRECTORY | os.O_CLOEXEC
    fd, above, at, in_shared = os.open("/", flags), 0, "/", False
    try:
        for i in range(len(names) + 1):
            status = os.fstat(fd)
            wrong = None
            is_shared = bool(status.st_mode & _WRITABLE)
            if is_shared and (i == len(names) or status.st_uid or not status.st_mode & stat.S_ISVTX):
                wrong = "other users than its owner can write to it"
            elif in_shared and status.st_uid not in (0, os.geteuid()):
                wrong = "another user than root or you made it, where any user can make one"
            elif above and status.st_uid != above and (status.st_uid or i == len(names)):
                wrong = "it is inside the folder of another user"
            if wrong:
                raise Error(f"{at}: not a trusted folder: {wrong}")
            if i == len(names):
                return fd, status.st_uid
            above, in_shared = status.st_uid or above, is_shared
            at = "/" + "/".join(names[:i + 1])
            inner = os.open(names[i], flags | os.O_NOFOLLOW, dir_fd=fd)
            os.close(fd)
            fd = inner
    except BaseException as e:
        os.close(fd)
        if isinstance(e, OSError) and e.errno in (errno.ENOTDIR, errno.ELOOP):
            raise Error(f"{at}: not a folder; symbolic links are not followed") from None
        if isinstance(e, OSError) and e.errno != errno.ENOENT:
            raise Error(f"{at}: {e.strerror}") from None
        raise


def _open_file(folder, name):
    """Opens and checks the file of a segment. Raises FileNotFoundError if there is none."""
    shared = folder == SHARED_FOLDER
    path = f"{folder}/{name}"
    if shared:
        place, owner = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC), None
    else:
        place, owner = _open_folder(folder)
    try:  # O_NONBLOCK: opening a FIFO must not block the reader
        fd = os.open(name, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK, dir_fd=place)
    except FileNotFoundError:
        raise
    except OSError as e:
        raise Error(f"{path}: {e.strerror}{' (join the group of the segment: ls -l shows it)' if e.errno == errno.EACCES else ''}") from None
    finally:
        os.close(place)
    status = os.fstat(fd)
    wrong = None
    if not stat.S_ISREG(status.st_mode):
        wrong = "not a segment"
    elif not shared and status.st_uid not in (owner, 0):
        wrong = "belongs neither to the owner of its folder nor to root: not a daemon's"
    elif status.st_mode & _WRITABLE:
        wrong = "others than its owner may write it: not a daemon's"
    elif status.st_size < _HEADER.size:
        wrong = "too short to be a segment"
    if wrong:
        os.close(fd)
        raise Error(f"{path}: {wrong}")
    return fd, status


class _Segment:
    """One open segment, checked."""

    _fd = None

    def __init__(self, name, folder=None):
        if not 0 < len(os.fsencode(name)) < NAME_SIZE:
            raise Error(f'node "{name:.100}": a name has 1 to {NAME_SIZE - 1} characters')
        if not _NAME_CHARACTERS.issuperset(name):
            raise Error(f'node "{name}": a name has the characters A-Z a-z 0-9 _ . - only')
        folders = [folder] if folder else _folders()
        for self.folder in folders:
            self.path = f"{self.folder}/tactiled.{name}"
            try:
                self._fd, status = _open_file(self.folder, f"tactiled.{name}")
                break
            except FileNotFoundError:
                pass
        else:
            raise Error(f'node "{name}": no daemon of that name runs: no tactiled.{name} in {" or ".join(folders)}')
        self.identity = status.st_dev, status.st_ino
        self._size = status.st_size
        try:
            self._check(status.st_size)
        except Error:
            self.close()
            raise

    def read(self, at, size):
        """Returns bytes of the file. Bytes beyond the end of a truncated file read as zeros, which are never a
        finished record."""
        data = os.pread(self._fd, size, at)
        return data if len(data) == size else data.ljust(size, b"\0")

    def word(self, at):
        return int.from_bytes(self.read(at, 4), sys.byteorder)

    def _error(self, what):
        return Error(f"{self.path}: {what}")

    def _check(self, size):
        data = self.read(0, _HEADER.size)
        self.header = h = Header._make(_HEADER.texts(data, 0))
        if data[:8] != MAGIC:
            raise self._error("no tactiled segment")
        if h.byte_order != BYTE_ORDER:
            raise self._error("written by a machine of the other byte order")
        if h.major != MAJOR:
            raise self._error(f"its layout is version {h.major}.{h.minor}, this reader knows {MAJOR}.{MINOR}: "
                              "take the tactiled.py that came with the daemon")
        if h.total_size > size or h.header_size < _HEADER.size:
            raise self._error("truncated")
        if h.n_sensors > MAX_SENSORS or h.n_links > MAX_LINKS:
            raise self._error("more sensors or links than can be")
        if h.sensor_size < _SENSOR_SIZE_1_0 or h.link_size < _LINK_SIZE:
            raise self._error("directory entries too small")
        for offset, whole, alignment in ((h.sensor_offset, h.sensor_size * h.n_sensors, 4),
                                         (h.link_offset, h.link_size * h.n_links, 128)):
            if offset % alignment or offset + whole > size:
                raise self._error("a directory lies outside")
        self.node = _Ring(self, h.node, _NODE.size)
        if not self.node.fits(size):
            raise self._error("the node ring lies outside")
        self.sensors = {}  # name -> (SensorInfo, _Ring), in the daemon's order
        self.arrays = {}  # name -> _Ring, for the sensors with taxels
        for i in range(h.n_sensors):
            info = self._entry(i)
            ring = _Ring(self, info.ring, _PLACED.size if info.ring[3] >= _PLACED.size else _SAMPLE.size)
            if not ring.fits(size):
                raise self._error("a sensor's ring lies outside")
            self.sensors[info.name] = info, ring
            if not info.arrays[2]:
                continue
            arrays = _Ring(self, info.arrays, _ARRAY.size + info.n_taxels * (4 * bin(info.taxel_components).count("1") + 1))
            if not 0 < info.n_taxels <= MAX_TAXELS or not arrays.fits(size) or info.taxel_place_offset + 24 * info.n_taxels > size:
                raise self._error("a sensor's array lies outside")
            self.arrays[info.name] = arrays

    def _entry(self, i):
        h = self.header
        at = h.sensor_offset + i * h.sensor_size
        entry = self.read(at, min(h.sensor_size, _SENSOR.size)).ljust(_SENSOR.size, b"\0")  # the entry of an older
                                                                                            # daemon is shorter
        info = SensorInfo._make(_SENSOR.texts(entry, 0))
        if h.sensor_size < _SENSOR.size:
            info = info._replace(undetected_mean=math.nan, undetected_worst=math.nan)
        return info if h.sensor_size >= _SENSOR_SIZE_1_8 else info._replace(age_bound_us=AGE_UNBOUNDED)

    def info(self, sensor):
        """Returns the directory's entry as it is now: the daemon may have reloaded its configuration."""
        i = list(self.sensors).index(sensor)
        for _ in range(_TRIES):
            reloads = self.word(_RELOADS_OFFSET)
            entry = self._entry(i)
            if reloads % 2 == 0 and self.word(_RELOADS_OFFSET) == reloads:
                break
        return entry

    def grasp_and_tool(self, grasp, tool, t_ns, now_ns):
        """Returns the Grasp and the Tool in a node record's bytes, judged. They are "not known" if the daemon has ended, if the
        daemon publishes none (before 1.1, 1.7), or if the record is older than a sensor's stale_ms."""
        grasp, tool = Grasp._make(_GRASP.texts(grasp, 0)), _tool(tool)
        limit_ms = min([self.header.watchdog_ms, *(info.stale_ms for info, _ in self.sensors.values())])
        fresh = _is_fresh(t_ns, now_ns, max(limit_ms, _MIN_GRASP_MS))
        if fresh and self.is_current() and self.header.node[3] >= _NODE_SIZE_1_1:
            return grasp, tool
        return _forgotten(grasp), _forgotten_tool(tool)

    def is_current(self):
        """False if the daemon has ended cleanly, a successor has taken over, or the file was truncated."""
        return STARTING <= self.word(_STATE_OFFSET) <= RUNNING and os.lseek(self._fd, 0, os.SEEK_END) >= self._size

    def is_alive(self, t_published_ns, now_ns):
        """Returns True if the daemon published within its watchdog_ms. The time is that of any of its records; if it
        is recent enough, the node record is not read."""
        return _is_fresh(t_published_ns, now_ns, self.header.watchdog_ms) or self.is_beating()

    def is_beating(self):
        """Returns True if the newest node record is at most watchdog_ms old. A record that is too old is read once more,
        because this thread may have been interrupted after it read it."""
        for _ in range(2):
            record = self.node.latest()
            if record is not None and _is_fresh(_NODE.values(record)[1], time.monotonic_ns(), self.header.watchdog_ms):
                return True
        return False

    def close(self):
        if self._fd is not None:
            os.close(self._fd)
        self._fd = None


class _Attached:
    """Attaches to a segment and finds the successor of its daemon. A context manager."""

    _segment = None
    _folder = None  # The folder of the first daemon; successors are searched for only there.
    _tried_ns = 0

    def close(self):
        if self._segment is not None:
            self._segment.close()
        self._segment = None

    def __del__(self):
        self.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def _attach(self, sensor=None):
        """Attaches to a successor that has the sensor, if there is one; at most each 10 ms. Returns True if it did."""
        now_ns = time.monotonic_ns()
        if now_ns - self._tried_ns < _ATTACH_NS:
            return False
        self._tried_ns = now_ns
        try:
            fresh = _Segment(self.name, self._folder)
        except (OSError, Error):
            return False
        same = self._segment is not None and self._segment.identity == fresh.identity
        if same or not fresh.is_current() or sensor is not None and sensor not in fresh.sensors:
            fresh.close()
            return False
        if self._segment is not None:
            self._segment.close()
        self._segment, self._folder = fresh, fresh.folder
        return True


class Node(_Attached):
    """The values of a node as they are now. A Node attaches automatically to the daemon that follows the one it was
    opened on."""

    def __init__(self, name, folder=None):
        self.name = name
        self._segment = _Segment(name, folder)
        self._folder = self._segment.folder
        if self._folder == SHARED_FOLDER:
            warnings.warn(f"any local user can create a segment in {SHARED_FOLDER} while its daemon does not run: nothing "
                          "proves that these values are measured", RuntimeWarning, stacklevel=3)
        self._known = set(self._segment.sensors)
        self._stale = False  # the last sample was stale: the daemon may be dead and its file removed

    def _now(self):
        if self._segment is None:
            raise Error(f'node "{self.name}": closed')
        if (self._stale or not self._segment.is_current()) and self._attach():
            self._known.update(self._segment.sensors)
        return self._segment

    def _require(self, sensor):
        if sensor not in self._known:
            raise Error(f'node "{self.name}" has no sensor "{sensor}"; it has: {", ".join(self.sensors)}')

    @property
    def sensors(self):
        """The names of the sensors, in the daemon's order."""
        return tuple(self._now().sensors)

    @property
    def header(self):
        """The daemon's own data: version, pid, epoch, ..."""
        return self._now().header

    def info(self, sensor):
        """The daemon's data about a sensor: model, serial, stale_ms, full_scale, freshness, age_bound_us, ..."""
        if sensor not in self._now().sensors:
            raise Error(f'node "{self.name}" has no sensor "{sensor}"')
        return self._segment.info(sensor)

    def reason_counts(self, sensor):
        """Returns the number of samples with each reason since the daemon started, as {word: count}, without reasons
        that never occurred."""
        counts = self.info(sensor).count  # all 0 from an older daemon, which does not count reasons
        return {word: count for word, count in zip(REASON_WORDS, counts) if count}

    def latest(self, sensor):
        """Returns the newest sample, which is BAD with a reason if there is no valid one. Never blocks."""
        segment = self._now()
        if sensor not in segment.sensors:
            self._require(sensor)
            return _invalidated(_NOTHING, DAEMON_STOPPED)  # the successor does not have it
        info, ring = segment.sensors[sensor]
        return self._newest(segment, info, ring)[1]

    def array(self, sensor):
        """Returns the newest Array of a sensor with taxels; its sample is BAD with a reason if there is no valid one. Never
        blocks."""
        segment = self._now()
        self._require(sensor)
        if sensor not in segment.arrays:
            raise Error(f'node "{self.name}": the sensor "{sensor}" has no taxels')
        info, ring = segment.sensors[sensor][0], segment.arrays[sensor]
        record, sample = self._newest(segment, info, ring, _COP_SD_OF_ARRAY)
        n_components = bin(info.taxel_components).count("1")
        return _array(record or bytes(ring.size), sample, info.n_taxels, n_components)

    def places(self, sensor):
        """Returns place, m, and normal of each taxel in frame S: a list of tuples of six numbers."""
        info = self.info(sensor)
        data = self._segment.read(info.taxel_place_offset, 24 * info.n_taxels)
        return list(struct.iter_unpack("=6f", data))

    def _newest(self, segment, info, ring, cop_sd_at=_SAMPLE.size):
        """Returns the newest record, None if there is none, and the sample that it begins with, judged."""
        for _ in range(2):  # twice for the reason in is_beating()
            record = ring.latest()
            if record is None:
                return None, _invalidated(_NOTHING, READER_OVERRUN if ring.head() else NO_DATA_YET)
            now_ns = time.monotonic_ns()
            sample = _judged(_sample(record, cop_sd_at), info.stale_ms, now_ns)
            if not sample.reasons & STALE:
                break
        if not (segment.is_current() and segment.is_alive(sample.t_published_ns, now_ns)):
            sample = _invalidated(sample, DAEMON_STOPPED)
        self._stale = sample.reasons & (STALE | DAEMON_STOPPED) != 0
        return record, sample

    def snapshot(self):
        """Returns (node record, {name: sample}) of one instant; the record's `grasp` is a Grasp, its `tool` a Tool. Raises Error if
        there is none yet."""
        segment = self._now()
        for tries in range(_TRIES):
            begun_ns = time.monotonic_ns()
            record = segment.node.latest()
            if record is None:
                break
            values = list(_NODE.values(record))
            at = NodeRecord._fields.index("command")
            values[at] = tuple(Command(*values[at][i:i + 3]) for i in (0, 3))
            count_at = NodeRecord._fields.index("count")
            samples = {}
            for (name, (_, ring)), count in zip(segment.sensors.items(), values[count_at]):
                record = ring.read(count - 1)
                if record is None:
                    break
                samples[name] = _sample(record)
            taken_ns = time.monotonic_ns()
            # The process was interrupted between reading and judging: the copy may be old, so it is read
            # again.
            if len(samples) < len(segment.sensors) or taken_ns - begun_ns > 10_000_000 and tries < _TRIES - 1:
                continue
            current = segment.is_current() and _is_fresh(values[1], taken_ns, segment.header.watchdog_ms)
            for name, (info, _) in segment.sensors.items():
                sample = _judged(samples[name], info.stale_ms, taken_ns)
                samples[name] = sample if current else _invalidated(sample, DAEMON_STOPPED)
            values[-2:] = segment.grasp_and_tool(values[-2], values[-1], values[1], taken_ns)
            node = NodeRecord._make(values)
            self._stale = any(sample.reasons & (STALE | DAEMON_STOPPED) for sample in samples.values())
            return node, samples
        raise Error(f'node "{self.name}": no whole snapshot: nothing published yet, or this reader is too slow')

    @property
    def grasp(self):
        """The present state of the gripper and its object: struct tactiled_grasp. Raises Error if there is none yet."""
        return self.snapshot()[0].grasp

    @property
    def tool(self):
        """The force and torque of the world on the gripper, in its frame G: struct tactiled_tool. NO_VALUE without [tool] in the
        daemon's configuration. Error when there is none yet."""
        return self.snapshot()[0].tool

    def follow(self, sensor, timeout=None, wait="events", from_oldest=False):
        """Returns an iterator of the samples of a sensor, in order: see Follower.

        timeout: seconds without a sample after which the iterator ends, None = never. wait: "events" sleeps until the
        daemon reports new records, or behaves as "sleep" if there is no control socket or no answer; "sleep" sleeps
        for 1 ms at a time; "poll" uses a whole CPU. from_oldest: begin with the oldest sample that is kept, not with
        the newest.
        """
        self._now()
        self._require(sensor)
        return Follower(self.name, sensor, timeout, wait, from_oldest, self._folder)


class _Events:
    """A descriptor from the control socket, for poll(). Each read of 8 bytes gives the number of node records, as
    long as the connection is open. Raises OSError if there is no descriptor within `seconds`."""

    def __init__(self, header, seconds):
        until = time.monotonic() + seconds
        self._connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            self._connection.settimeout(seconds)  # connect() does not wait for room in the queue of a hung daemon
            self._connection.connect(os.fsencode(header.control))
            self._connection.send(f"{header.name} events".encode("utf-8", "surrogateescape"))
            self._connection.settimeout(max(until - time.monotonic(), 1e-6))
            _, fds, _, _ = socket.recv_fds(self._connection, 64, 1, socket.MSG_CMSG_CLOEXEC)
            if not fds:
                raise OSError("the daemon gives no events")
        except OSError:
            self._connection.close()
            raise
        self._event = os.fdopen(fds[0], "rb", buffering=0)
        self._poll = select.poll()
        self._poll.register(self._event, select.POLLIN)
        self._poll.register(self._connection, select.POLLIN)

    def wait(self, seconds):
        """Sleeps until the daemon has published. Returns False if the daemon has closed the connection."""
        for fd, _ in self._poll.poll(seconds * 1000):
            if fd == self._connection.fileno():
                return False
            while (event := self._event.read(8)) is not None:  # reads all events: the ring is read afterwards
                if not event:
                    return False
        return True

    def close(self):
        self._connection.close()
        self._event.close()


class Follower(_Attached):
    """Iterates over each sample of one sensor once, in order. When the daemon ends, hangs or dies, the samples that
    are left in the ring come first, then one BAD sample, then the samples of the successor. The count of samples that
    were overwritten before this reader read them is `lost`. After a timeout, the next loop continues where this one
    ended."""

    _events = None

    def __init__(self, name, sensor, timeout=None, wait="events", from_oldest=False, folder=None):
        if wait not in ("events", "sleep", "poll"):
            raise ValueError(f'wait = "{wait}": choose "events", "sleep" or "poll"')
        self.name, self.sensor, self._folder = name, sensor, folder
        self.lost = 0
        self._timeout, self._how = timeout, wait
        self._last = None           # the last sample returned
        self._next = None           # number of the next record, None = not known yet
        self._oldest = from_oldest  # begin with the oldest sample
        self._broken = False        # the daemon has ended, hangs or is dead
        self._empty = 0             # attempts without a new sample
        self._asked_ns = None       # time of the last request for events
        self._closed = False
        self._attach(sensor)

    def close(self):
        self._closed = True
        self._drop_events()
        super().close()

    def __iter__(self):
        return self

    def __next__(self):
        sample = None if self._closed else self._take()
        until = math.inf if self._timeout is None else time.monotonic() + self._timeout
        while sample is None:
            left = until - time.monotonic()
            if self._closed or left <= 0:
                raise StopIteration
            self._sleep(left)
            sample = self._take()
        return sample

    def _attach(self, sensor=None):
        if not super()._attach(sensor):
            return False
        self._drop_events()
        self._asked_ns = None
        self._broken = False
        self._next = None if self._last is None else 0  # records that are overwritten already count as lost
        return True

    def _take(self):
        if self._segment is not None:
            info, ring = self._segment.sensors[self.sensor]
            if self._next is None:
                self._next = ring.oldest_number() if self._oldest else ring.newest_number()
            record = self._next_record(ring)
            if record is not None:
                now_ns = time.monotonic_ns()
                self._last = _judged(_sample(record), info.stale_ms, now_ns)
                self._broken = False
                if not self._segment.is_alive(self._last.t_published_ns, now_ns):
                    self._last = _invalidated(self._last, STALE)  # one sample reports the stop, after the samples
                                                                  # that are left
                return self._last
            self._empty += 1
            if self._how == "poll" and self._empty % 16 and self._segment.is_current():
                return None
        sample = self._look()
        if sample is None and (self._segment is None or self._broken):
            self._attach(self.sensor)
        return sample

    def _next_record(self, ring):
        for _ in range(_TRIES):
            number = self._next
            ahead = ring.lock_of(number) - (2 * number + 2) & _WORD
            if ahead == 0:
                record = ring.read(number)
                if record is not None:
                    self._next = number + 1 & _WORD
                    return record
            elif ahead >> 31:
                return None  # not written yet
            self._next = ring.oldest_number()
            self.lost += self._next - number & _WORD
        return None

    def _look(self):
        """Checks, when there is no new sample, whether the daemon has ended or died. If so, returns one BAD sample
        with the reason."""
        segment = self._segment
        ended = segment is None
        if not ended:
            ring = segment.sensors[self.sensor][1]
            if ring.slots < (ring.head() - self._next & _WORD) < 2**31:  # the reader slept for 2^30 records; next can
                                                                         # be one ahead of the head
                number, self._next = self._next, ring.oldest_number()
                self.lost += self._next - number & _WORD
            ended = not segment.is_current() or not segment.is_beating()
        self._broken = ended
        if not ended or self._last is None or self._last.reasons & DAEMON_STOPPED:
            return None
        self._last = _invalidated(self._last, DAEMON_STOPPED)
        return self._last

    def _sleep(self, left_s):
        if self._how == "poll":
            return
        now_ns = time.monotonic_ns()
        if (self._how == "events" and self._events is None and self._segment is not None and not self._broken and
                (self._asked_ns is None or now_ns - self._asked_ns >= _ASK_NS)):
            self._asked_ns = now_ns
            try:
                self._events = _Events(self._segment.header, min(left_s, _LOOK_S))
            except OSError:
                pass
            return  # the request took long
        if self._events is None or self._broken:
            time.sleep(min(left_s, _NAP_S))
        elif not self._events.wait(min(left_s, _LOOK_S)):
            self._drop_events()

    def _drop_events(self):
        if self._events is not None:
            self._events.close()
        self._events = None


def open(name, folder=None):
    """Returns the node with that name, in `folder` or, if that is None, in the folders of folder.h. Raises Error with
    the reason if the node cannot be read."""
    return Node(name, folder)

"""The register map as mbpoll reads it, with the command lines of the manual, over TCP or a serial line."""
import re
import subprocess
import time

VALUE = re.compile(r"^\[(\d+)\]:\s+(\S+)(?: \((-?\d+)\))?\s*$", re.MULTILINE)


class Mbpoll:
    def __init__(self, *where):
        """where: the words that select the server, with its host or device last."""
        *self.options, self.host = map(str, where)

    def run(self, words, values=()):
        command = ["mbpoll", *self.options, "-0", "-1", *words.split(), self.host]
        return subprocess.run([*command, *map(str, values)], capture_output=True, text=True, timeout=60)

    def read(self, words):
        """Returns the values as numbers; a 16-bit one that mbpoll shows as "65236 (-300)" is the signed one."""
        done = self.run(words)
        assert done.returncode == 0, f"{done.args}: {done.stdout}{done.stderr}"
        return [float(signed or shown) for _, shown, signed in VALUE.findall(done.stdout)]

    def unsigned(self, words):
        return [int(value) % 0x10000 for value in self.read(words)]

    def write(self, words, *values):
        done = self.run(words, values)
        assert done.returncode == 0, f"{done.args}: {done.stdout}{done.stderr}"

    def refusal(self, words, *values):
        done = self.run(words, values)
        known = {"Illegal function": 1, "Illegal data address": 2, "Illegal data value": 3}
        return next((code for text, code in known.items() if done.returncode != 0 and text in done.stderr), done.stderr)

    def table(self):
        return {**self.reads(), **self.scratch(), **self.tares(), "refused": self.refusals()}

    def reads(self):
        constants = self.unsigned("-t 4 -r 9000 -c 12")
        return {
            "magic": self.unsigned("-t 4 -r 0 -c 2"),
            "map_version": self.unsigned("-t 4 -r 2")[0],
            "constants": constants,
            "constants_fc4": self.unsigned("-t 3 -r 9000 -c 12"),
            "int16": self.read("-t 4 -r 9001")[0],
            "int32": self.read("-t 4:int -B -r 9002")[0],
            "float_abcd": self.read("-t 4:float -B -r 9004")[0],
            "float_cdab": self.read("-t 4:float -r 9006")[0],
            "text": b"".join(word.to_bytes(2, "big") for word in constants[8:]).decode(),
            "force_cN": self.read("-t 3 -r 104 -c 3"),
            "force_N": self.read("-t 4:float -B -r 2102 -c 3"),
            "force_N_low_word_first": self.read("-t 3:float -r 3102 -c 3"),
            "inputs_ok": self.read("-t 1 -r 32 -c 2"),
            "coils": self.read("-t 0 -r 0 -c 34"),
        }

    def scratch(self):
        self.write("-t 4 -r 5100", 0xA55A)
        self.write("-t 4 -r 5101", 1, 0xFFFF, 3)
        return {"scratch_fc6": self.unsigned("-t 4 -r 5100")[0], "scratch_fc16": self.unsigned("-t 4 -r 5101 -c 3")}

    def tares(self):
        before, sequence = self.count(), self.unsigned("-t 4 -r 25")[0] + 1
        self.write("-t 4 -r 5000", 1, 1, 0, 0, sequence)
        ack, state, result = self.until("-t 4 -r 25 -c 3", lambda seen: seen[0] == sequence and seen[1] != 1)
        block = [ack - sequence, state, result, self.count() - before]

        before = self.count()
        self.write("-t 4 -r 5010", 1)
        register = self.until("-t 4 -r 120", lambda seen: seen[0] != before)[0] - before
        self.until("-t 4 -r 7", lambda seen: not seen[0] & 0x100)

        before = self.count()
        self.write("-t 0 -r 0", 1)
        self.until("-t 0 -r 0", lambda seen: seen == [0])
        coil = self.until("-t 4 -r 120", lambda seen: seen[0] != before)[0] - before
        self.write("-t 0 -r 16", 1, 0)
        return {"tare_block": block, "tare_register": register, "tare_coil": coil}

    def count(self):
        return self.unsigned("-t 4 -r 120")[0]

    def until(self, words, good):
        end = time.monotonic() + 3
        seen = self.unsigned(words)
        while not good(seen) and time.monotonic() < end:
            seen = self.unsigned(words)
        return seen

    def refusals(self):
        return [self.refusal("-t 4 -r 0", 1), self.refusal("-t 4 -r 9000", 1, 2),
                self.refusal("-t 0 -r 34", 1), self.refusal("-t 0 -r 33", 0, 0)]

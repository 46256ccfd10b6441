"""Words of tactilectl decouple for labelled rows, which are no stream."""
import subprocess


def alone(tactilectl):
    """--each-row-alone; none for an older program, which knows nothing else."""
    text = subprocess.run([tactilectl, "decouple", "--help"], capture_output=True, text=True, check=False).stdout
    return ["--each-row-alone"] if "--each-row-alone" in text else []

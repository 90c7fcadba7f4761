"""Instructions of each detection stage per surface triangle, counted by callgrind.

The difference of two runs of different length, so that reading and building do not count. Valgrind
knows no AVX-512: the AVX2 path is what is counted.
"""

import re
import shutil
import subprocess
import sys

TIMES = (1, 3)
STAGES = ("refit", "intersections", "proximity", "pack")


def count(program: str, stage: str, times: int) -> tuple[int, int]:
    """Instructions of a run, and the number of triangles that the program names."""
    command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null"]
    run = subprocess.run(
        [*command, program, stage, str(times)], capture_output=True, text=True, check=True
    )
    return int(re.search(r"Collected : (\d+)", run.stderr)[1]), int(run.stdout)


def main() -> None:
    """Print the table for the program that the command line names."""
    if shutil.which("valgrind") is None:
        print("Instruction counts left out: valgrind is not installed.")
        return
    print(f"{'stage':16}{'instructions':>14}{'per triangle':>14}")
    for stage in STAGES:
        (few, triangles), (many, _) = (count(sys.argv[1], stage, times) for times in TIMES)
        each = (many - few) / (TIMES[1] - TIMES[0])
        print(f"{stage:16}{each:14,.0f}{each / triangles:14.1f}")


if __name__ == "__main__":
    main()

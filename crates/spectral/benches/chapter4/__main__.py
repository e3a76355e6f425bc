"""Chapter 4 of the thesis, the Hierarchical Subspace Iteration Method, measured again: each subcommand prints one of its tables, or the numbers of one of its figures,
as Markdown, ours beside the thesis'.

    python3 crates/spectral/benches/chapter4 table2 --program target/release/chladni --meshes FOLDER --record runs.jsonl

Every solve is a process of its own on one thread, and figures are processor seconds, which other work on the machine changes little. What stands in the file of
`--record` is not measured again. `--large` takes meshes and counts nearer to the thesis', which need hours and up to 16 GB. The peers need NumPy, SciPy and the
package `chladni`, whose matrices they solve; with scikit-sparse they factorise by CHOLMOD, else by SuperLU, several times slower. Pictures need Matplotlib.
"""

import argparse
import sys

import figures
import tables
from runs import Runs

COMMANDS = {
    name: getattr(module, name)
    for module, names in (
        (tables, ("check", "table2", "table3", "table4", "table5", "table6", "table4a1", "table4a3")),
        (figures, ("figure5", "figure6", "figure7", "figure10", "figure11")),
    )
    for name in names
}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=[*COMMANDS, "all"], nargs="+")
    parser.add_argument("--program", default="target/release/chladni")
    parser.add_argument(
        "--meshes", required=True, help="a folder with armadillo.obj, igea.ply, rocker-arm.off, rolling-stage.obj, face.obj and bumpy-cube.obj"
    )
    parser.add_argument("--record", help="a file of JSON lines that runs of one version of the program are added to, and taken from")
    parser.add_argument("--limit", type=float, default=900, help="processor seconds of one run")
    parser.add_argument("--repeat", type=int, default=1, help="runs of each, of which the quickest counts")
    parser.add_argument("--pictures", help="a folder for SVG pictures of the figures")
    parser.add_argument("--large", action="store_true")
    arguments = parser.parse_args()
    runs = Runs(arguments.program, arguments.meshes, arguments.record, arguments.limit, sys.executable, arguments.repeat)
    for what in COMMANDS if "all" in arguments.what else arguments.what:
        print(f"## {what}: {COMMANDS[what].__doc__}\n", flush=True)
        extra = {"pictures": arguments.pictures} if what.startswith("figure") else {}
        COMMANDS[what](runs, arguments.large, **extra)

"""Many sequences, seeds and settings, on one machine or many: a folder of sequences in, packages and one table of figures out.

The work is spread by Ray (`pip install sinew[farm]`); without an address it runs on this machine. A task that is lost with its worker is
run again, one that was done before is not: the table is complete in the end, and packages have the same bytes wherever they were made.
Every machine must see the sequences under the same path. On the command line::

    python -m sinew.farm sequences/ -o farm/ --every 10 --seeds 0 1 2 --settings wide=wide.toml
"""

import argparse
import csv
import hashlib
import json
import os
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import sinew

__all__ = ["farm", "learn_one"]

COLUMNS = (
    "sequence", "settings", "seed", "shapes", "vertices", "components", "bytes", "sha256", "seconds",
    "encoder", "encoder_sted", "features", "features_sted", "positions", "positions_sted", "round_trip",
)  # fmt: skip


def learn_one(path: str, settings: str, seed: int, every: int) -> tuple[bytes, dict[str, Any]]:
    """Trains on one shape in `every` and measures on the others. Returns the package's bytes and its row, without names."""
    begun = time.monotonic()
    positions, faces = sinew.read(path)
    package = sinew.train(positions, faces, shapes=range(0, len(positions), every), seed=seed, config=settings or None)
    seconds = time.monotonic() - begun
    figures = package.evaluate(positions)
    data = package.to_bytes()
    row = {
        "shapes": len(positions),
        "vertices": package.vertex_count,
        "components": len(package.components),
        "bytes": len(data),
        "sha256": hashlib.sha256(data).hexdigest(),
        "seconds": round(seconds, 1),
        "round_trip": figures["round_trip"]["e_rms"],
    }
    for short, long in (("encoder", "encoder"), ("features", "feature_projection"), ("positions", "position_projection")):
        row[short], row[f"{short}_sted"] = figures[long]["e_rms"], figures[long]["sted"]
    return data, row


def replace(path: Path, data: bytes) -> None:
    """Writes a file, whole or not at all."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    beside.write_bytes(data)
    beside.replace(path)


def farm(
    sequences: Iterable[str | os.PathLike[str]],
    output: str | os.PathLike[str],
    *,
    seeds: Iterable[int] = (0,),
    settings: Mapping[str, str] | None = None,
    every: int = 10,
    cpus: int = 1,
    address: str | None = None,
    progress: bool = False,
) -> list[dict[str, Any]]:
    """Learns every sequence with every seed and every settings, and writes `output/NAME.sinew`, a row beside each, and
    `output/figures.csv`. What stands there already is not learned again: give each set of shapes and settings names of its own.

    sequences: folders or files, as `sinew.read` takes them, of different names.
    settings: TOML text by name; the name "" stands for the defaults.
    every: train on one shape in so many.
    cpus: processors that a task asks Ray for.
    address: of a Ray cluster; by default one that runs already (`RAY_ADDRESS`), or this machine.
    Returns the rows of the table. A task that Sinew refuses has its sentence in the column `error`, and no package.
    """
    paths: dict[str, Path] = {}
    for path in map(Path, sequences):
        if path.stem in paths:
            raise sinew.SinewError(f"{paths[path.stem]} and {path} have one name, and so would their packages: rename one")
        paths[path.stem] = path.resolve()
    if not paths:
        raise sinew.SinewError("there are no sequences")
    import ray

    output = Path(output)
    output.mkdir(parents=True, exist_ok=True)
    settings = {"": ""} if settings is None else settings
    jobs = {
        "-".join(filter(None, (name, label, f"seed{seed}"))): (name, label, seed)
        for name in paths
        for label in settings
        for seed in seeds
    }
    rows: dict[str, dict[str, Any]] = {}
    for job in jobs:
        kept = output / f"{job}.json"
        if kept.exists() and (output / f"{job}.sinew").exists():
            rows[job] = json.loads(kept.read_text())
    if not ray.is_initialized():
        ray.init(address=address, log_to_driver=False)
    # A package does not depend on the number of threads, so each worker takes what it was given.
    learn = ray.remote(num_cpus=cpus, max_retries=5, runtime_env={"env_vars": {"RAYON_NUM_THREADS": str(cpus)}})(learn_one)
    waiting = {}
    for job, (name, label, seed) in jobs.items():
        if job not in rows:
            waiting[learn.remote(str(paths[name]), settings[label], seed, every)] = job
    while waiting:
        (done,), _ = ray.wait(list(waiting), num_returns=1)
        job = waiting.pop(done)
        name, label, seed = jobs[job]
        row = {"sequence": name, "settings": label, "seed": seed}
        try:
            data, figures = ray.get(done)
        except sinew.SinewError as error:
            # Ray adds where it happened; the sentence is Sinew's.
            row["error"] = str(getattr(error, "cause", error))
        else:
            row |= figures
            replace(output / f"{job}.sinew", data)
            replace(output / f"{job}.json", json.dumps(row, indent=1).encode())
        rows[job] = row
        if progress:
            print(f"{len(rows)}/{len(jobs)} {job}: {row.get('error', 'learned')}", flush=True)
    table = [rows[job] for job in jobs]
    with open(output / ".figures.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, (*COLUMNS, "error"))
        writer.writeheader()
        writer.writerows(table)
    (output / ".figures.csv").replace(output / "figures.csv")
    return table


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser("python -m sinew.farm", description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder of sequences, each a folder or a file")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of packages and figures.csv")
    parser.add_argument("--every", type=int, default=10, help="train on one shape in so many [10]")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0], help="seeds [0]")
    parser.add_argument("--settings", nargs="+", default=[], metavar="NAME=FILE", help="settings as TOML files [the defaults]")
    parser.add_argument("--cpus", type=int, default=1, help="processors a task [1]")
    parser.add_argument("--address", help="a Ray cluster [this machine]")
    arguments = parser.parse_args()
    if not arguments.folder.is_dir():
        parser.error(f"{arguments.folder} is no folder")
    sequences = sorted(path for path in arguments.folder.iterdir() if not path.name.startswith("."))
    settings = {}
    for item in arguments.settings:
        name, _, file = item.partition("=")
        if not name or not Path(file).is_file():
            parser.error(f"{item} is not NAME=FILE of a file that is there")
        settings[name] = Path(file).read_text()
    try:
        table = farm(
            sequences,
            arguments.output,
            seeds=arguments.seeds,
            settings=settings or None,
            every=arguments.every,
            cpus=arguments.cpus,
            address=arguments.address,
            progress=True,
        )
    except sinew.SinewError as error:
        parser.error(f"{arguments.folder}: {error}")
    failed = [row for row in table if "error" in row]
    print(f"{arguments.output / 'figures.csv'}: {len(table)} rows, {len(failed)} refused")
    raise SystemExit(2 if failed else 0)


if __name__ == "__main__":
    main()

"""`rope_twin scene import FILE` and `scene export SCENE`: models of other programs."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rope_twin.cli import ExitCode, print_json
from rope_twin.errors import InputError
from rope_twin.interchange import write_scene
from rope_twin.interchange.fmu import export_fmu, inputs_of, outputs_of
from rope_twin.interchange.moordyn import deck_of, scene_of
from rope_twin.interchange.moordyn_deck import CURRENT_FILE, current_text, deck_text, read_deck
from rope_twin.interchange.orcaflex import scene_of_model
from rope_twin.run.arguments import add_command, add_json, add_out, add_scene, measure
from rope_twin.scene.load import load_scene
from rope_twin.scene.rope_warnings import sense_checks

IMPORTS = (
    "scene import mooring.txt --breaking-load 5MN --out mooring.yaml",
    "scene import lowering.yml --breaking-load 1.2MN --out lowering.yaml --json",
)
EXPORTS = (
    "scene export smooth_2km --moordyn --out lines.txt",
    "scene export my_lift.yaml --moordyn --out deck/lines.txt --json",
    "scene export deep_lift --fmu --out deep_lift.fmu",
)


def add_import(actions: argparse._SubParsersAction[Any]) -> None:
    about = "make a scene of a MoorDyn deck or an OrcaFlex text data file"
    more = (
        "Reads lines, their ends, points or buoys, water, seabed, current and, from OrcaFlex "
        "(.yml, .yaml), waves and the vessel with its RAOs. What has no equal is listed, here and "
        "at the top of the scene's file. Neither format states a breaking load."
    )
    parser = add_command(actions, "import", about, IMPORTS, more)
    parser.add_argument("file", metavar="FILE", help="deck of MoorDyn 2, or .yml of OrcaFlex")
    words = "minimum breaking load (MBL) of the lines"
    parser.add_argument(
        "--breaking-load", type=measure("N"), required=True, metavar="FORCE", help=words
    )
    add_out(parser, "YAML", "scene file to write", required=True)
    add_json(parser)


def add_export(actions: argparse._SubParsersAction[Any]) -> None:
    about = "write a scene as the input of another program"
    more = (
        "Points are where the static equilibrium has them. What a deck cannot have is listed; "
        f"a current goes to {CURRENT_FILE} beside the deck, where MoorDyn looks for it. An FMU 3.0 "
        "for co-simulation has the motion of the hang-off as inputs; it needs rope_twin in the "
        "Python of the program that loads it."
    )
    parser = add_command(actions, "export", about, EXPORTS, more)
    add_scene(parser)
    parser.add_argument("--moordyn", action="store_true", help="as a deck of MoorDyn 2")
    parser.add_argument("--fmu", action="store_true", help="as an FMU 3.0 for co-simulation")
    add_out(parser, "FILE", "file to write", required=True)
    add_json(parser)


def run_import(args: argparse.Namespace) -> int:
    """Write a scene and return the exit code. Raises RopeTwinError."""
    low, high = 1e2, 1e9
    if not low <= args.breaking_load <= high:
        what = f"it is {args.breaking_load:g} N"
        raise InputError("--breaking-load", what, f"right is {low:g} to {high:g} N")
    if args.out.suffix not in (".yaml", ".yml"):
        raise InputError("--out", f"'{args.out}' is no scene", "end it in .yaml")
    if Path(args.file).resolve() == args.out.resolve():
        raise InputError("--out", "it is the file to import", "give another name")
    file, breaking_load_n = Path(args.file), args.breaking_load
    if file.suffix.lower() in (".yml", ".yaml"):
        found = scene_of_model(file, breaking_load_n, args.out.parent)
    else:
        found = scene_of(read_deck(file), file, breaking_load_n)
    scene = write_scene(found, args.out)
    warnings = sense_checks(scene)
    if args.json:
        print_json({"scene": args.out, "left_out": list(found.left_out), "warnings": warnings})
        return ExitCode.OK
    print(f"{args.out}: {len(scene.ropes)} ropes, {len(scene.payloads)} payloads")
    for words in found.left_out:
        print(f"not imported: {words}")
    for warning in warnings:
        print(f"warning: {warning}")
    return ExitCode.OK


def _run_fmu(args: argparse.Namespace) -> int:
    scene = export_fmu(args.scene, args.out)
    given, found = list(inputs_of(scene)), list(outputs_of(scene))
    if args.json:
        print_json({"files": [args.out], "inputs": given, "outputs": found})
        return ExitCode.OK
    names = f"{len(given)} inputs, {len(found)} outputs"
    print(f"{args.out}: {names}, communication steps of multiples of {scene.time.step_s:g} s")
    return ExitCode.OK


def run_export(args: argparse.Namespace) -> int:
    """Write a deck or an FMU and return the exit code. Raises RopeTwinError."""
    if args.moordyn == args.fmu:
        what = "two formats are named" if args.fmu else "no format is named"
        raise InputError("scene export", what, "give --moordyn or --fmu")
    if args.fmu:
        return _run_fmu(args)
    deck, left_out = deck_of(load_scene(args.scene))
    files = [args.out]
    try:
        args.out.parent.mkdir(parents=True, exist_ok=True)
        args.out.write_text(deck_text(deck), encoding="utf-8")
        if deck.current:
            files.append(args.out.parent / CURRENT_FILE)
            files[1].write_text(current_text(deck), encoding="utf-8")
    except OSError as error:
        right = "give a place that can be written"
        raise InputError(str(args.out), f"it cannot be written ({error.strerror})", right) from None
    if args.json:
        print_json({"files": files, "left_out": list(left_out)})
        return ExitCode.OK
    counts = f"{len(deck.lines)} lines, {len(deck.points)} points"
    print(f"{' and '.join(map(str, files))}: {counts}")
    for words in left_out:
        print(f"not exported: {words}")
    return ExitCode.OK

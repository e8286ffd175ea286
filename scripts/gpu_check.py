#!/usr/bin/env python3
"""What the stages of scripts/gpu_check.sh found: judged one by one, collected in OUT/report.json, shown in OUT/report.md.

    gpu_check.py stage OUT WORK NUMBER NAME BEGAN CODE      one line; exit code 1 if the stage failed
    gpu_check.py report OUT                                 the tables

Needs nothing but Python: a machine without numpy and torch still gets its report.
"""

import array
import json
import math
import os
import pathlib
import platform
import statistics
import sys
import time

CASES = [f"paper-{m}" for m in range(1, 7)] + ["shipped", "smoke"]
ITERATIONS = 200_000


def read(path):
    """JSON of a file that a stage may not have got to write; None then."""
    try:
        return json.loads(path.read_text())
    except (OSError, ValueError):
        return None


def memory(path):
    """Largest device memory in use (MiB), and what other programs used before; None without nvidia-smi."""
    try:
        samples = [float(line) for line in path.read_text().split() if line.replace(".", "").isdigit()]
    except OSError:
        return None
    return {"peak_mib": max(samples), "before_mib": samples[0]} if samples else None


def duration(seconds):
    days, hours = divmod(round(seconds / 3600), 24)
    return f"{days} d {hours} h" if seconds >= 3600 else f"{seconds / 60:.0f} min"


def environment(work, log, report):
    cpu = [line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")]
    found = {"cores": os.cpu_count(), "processor": cpu[0] if cpu else platform.machine()}
    # Of what the program's libraries log, the lines about adapters; of vulkaninfo the devices; of nvidia-smi the whole.
    found["adapters"] = [line.strip() for line in log if "adapter" in line.lower() or "deviceName" in line][:20]
    found["log"] = log[:80]
    smi = [line for line in log if "Driver Version" in line]
    names = [line.split("|")[1] for line in log if line.startswith("|   0 ")][:1]
    gpu = " ".join(" ".join(names + smi[:1]).replace("|", " ").split()) or "no NVIDIA GPU"
    return True, f"{gpu}; {found['cores']} cores, {found['processor']}", found


def agreement(work, log, report):
    found = {"demanded": read(work / "backends.json"), "large": read(work / "backends-large.json")}
    if not found["demanded"]:
        return False, "no result", found
    row = found["demanded"][-1]
    line = (f"{row['device']} beside flex: loss {row['loss_difference']:.1e}, positions {row['position_difference_m']:.1e} m, "
            f"gradients {row['gradient_difference']:.1e}")
    if found["large"]:
        large = found["large"][-1]
        line += f"; large networks: loss {large['loss_difference']:.1e}, gradients {large['gradient_difference']:.1e}"
    # The command itself compares with its limits, and fails.
    return True, line, found


def steps(work, log, report):
    found = {}
    for name in CASES:
        result = read(work / f"step-{name}.json")
        if result and result["cases"]:
            case = result["cases"][0]
            found[name] = {
                "device": result["device"], "threads": result["threads"], "memory": memory(work / f"step-{name}.memory"),
                "steps_per_second": 1e3 / case["costs"]["step_ms"], **case,
            }
    paper = [found[name]["costs"]["step_ms"] for name in CASES[:6] if name in found]
    if len(paper) == 6:
        found["paper-mean"] = {"step_ms": statistics.mean(paper), "steps_per_second": 1e3 / statistics.mean(paper)}
    line = ", ".join(f"{name} {case['steps_per_second']:.2f}/s" for name, case in found.items())
    return all(name in found for name in CASES), line or "no result", found


def pytorch(work, log, report):
    found, line = {}, []
    for name in ("paper-1", "paper-3", "paper-6", "shipped", "smoke"):
        if not (case := read(work / f"torch-{name}.json")):
            line.append(f"{name} none")
            continue
        found[name] = case | {"memory": memory(work / f"torch-{name}.memory")}
        step = case["parts"]["step"]
        times = [step[side] for side in ("torch_ms", "torch_tf32_ms") if side in step]
        line.append(f"{name} " + "/".join(f"{1e3 / ms:.2f}" for ms in times) + "/s")
    return len(found) == 5, ", ".join(line), found


def shares(case):
    """Milliseconds of a step by what computes them. What the losses take beyond their own time is moved data."""
    phases, losses = dict(case["profile"]["phases_ms"]), case["costs"]["losses_ms"]
    groups = {
        "networks": ["embedding", "vertex products", "draping", "skinning", "untangling"],
        "backward": ["backward"], "update": ["clip", "optimiser"], "wait for scene": ["data wait"], "other": ["other"],
    }
    found = {name: sum(phases[part] for part in parts) for name, parts in groups.items()}
    found["host losses"] = min(losses, phases["energies"])
    found["transfers"] = phases["tensors"] + phases["energies"] - found["host losses"]
    return found


def profile(work, log, report):
    found = {}
    for path in sorted(work.glob("profile-*.json")):
        if (result := read(path)) and result["cases"]:
            case = result["cases"][0]
            found[f"{result['threads']} threads"] = {"shares_ms": shares(case), **case["profile"]}
    parts = lambda case: ", ".join(f"{part} {ms:.0f}" for part, ms in case["shares_ms"].items() if ms >= 0.5)
    line = "; ".join(f"{name}: {case['step_ms']:.0f} ms = {parts(case)}" for name, case in found.items())
    return bool(found), line or "no result", found


def training(work, log, report):
    try:
        lines = (work / "training" / "metrics.jsonl").read_text().splitlines()
        metrics = [json.loads(line) for line in lines if line.endswith("}")]
    except OSError:
        metrics = []
    if len(metrics) < 12:
        return False, f"only {len(metrics)} steps", {"steps": len(metrics)}
    window = min(50, len(metrics) // 3)
    # JSON has no NaN: a loss that is none is null.
    losses = [math.nan if m["loss"] is None else m["loss"] for m in metrics]
    first, last = statistics.mean(losses[:window]), statistics.mean(losses[-window:])
    # The first steps compile kernels and fill caches.
    usual = metrics[len(metrics) // 10:]
    pace = statistics.mean(m["seconds"] for m in usual)
    found = {
        "steps": len(metrics), "window": window, "first_loss": first, "last_loss": last,
        "median_losses": [statistics.median(losses[:window]), statistics.median(losses[-window:])], "steps_per_second": 1 / pace,
        "wait_share": sum(m["wait_seconds"] for m in usual) / sum(m["seconds"] for m in usual),
        "mean_layers": statistics.mean(m["layers"] for m in usual), "memory": memory(work / "training.memory"),
        "skipped": sum(m.get("skipped", False) for m in metrics), "seconds_for_200000": ITERATIONS * pace,
        "seconds_by_layers": {m: statistics.median(times) for m in range(1, 7)
                              if (times := [x["seconds"] for x in usual if x["layers"] == m])},
        "losses": losses,
    }
    ok = all(map(math.isfinite, losses)) and not found["skipped"] and last < first
    line = (f"{len(metrics)} steps, loss {first:.4g} -> {last:.4g}, {1 / pace:.2f} steps/s; "
            f"200,000 such iterations: {duration(ITERATIONS * pace)}")
    if alone := by_schedule(report):
        line += f"; by the schedule of paper.toml (half of them single garments): {duration(alone)}"
        found["seconds_by_schedule"] = alone
    return ok, line, found


def by_schedule(report):
    """Seconds of configs/paper.toml by the steps of stage 3: half of the iterations with one garment, half with 1 to 6."""
    cases = report.get("steps", {}).get("found", {})
    if "paper-mean" in cases and "paper-1" in cases:
        return ITERATIONS / 2e3 * (cases["paper-1"]["costs"]["step_ms"] + cases["paper-mean"]["step_ms"])


def floats(path):
    data = path.read_bytes()
    return array.array("f", data[8 + int.from_bytes(data[:8], "little"):])


def resume(work, log, report):
    try:
        whole, resumed = (floats(work / f"{name}.safetensors") for name in ("uninterrupted", "resumed"))
    except OSError:
        return False, "no result", {}
    apart = max((abs(a - b) for a, b in zip(whole, resumed)), default=0.0)
    same = whole == resumed
    line = f"{len(whole)} parameters bit-identical" if same else f"parameters differ by up to {apart:.2g}"
    return same, line, {"identical": same, "largest_difference": apart}


def stage(out, work, number, name, began, code):
    report = read(out / "report.json") or {}
    path = work / f"{number}-{name}.log"
    log = path.read_text(errors="replace").splitlines()
    try:
        ok, line, found = globals()[name](work, log, report)
    except Exception as error:  # One stage's odd file must not cost the others.
        ok, line, found = False, f"{type(error).__name__}: {error}", {}
    ok = ok and code == 0
    seconds = time.time() - began
    report[name] = {"stage": number, "ok": ok, "seconds": round(seconds, 1), "exit_code": code, "summary": line}
    report[name]["found"] = found
    print(f"{number} {name}: {'ok' if ok else 'FAILED'}, {seconds:.0f} s: {line}", flush=True)
    if not ok:
        report[name]["end_of_log"] = log[-40:]
        print("\n".join(f"    {line[:300]}" for line in log[-6:]), flush=True)
    temporary = out / "report.json.tmp"
    temporary.write_text(json.dumps(report, indent=1))
    temporary.replace(out / "report.json")
    return ok


def number(value, form=".0f"):
    return "" if value is None else format(value, form)


def table(head, rows):
    return "\n".join(["| " + " | ".join(head) + " |", "|---|" + "---:|" * (len(head) - 1)]
                     + ["| " + " | ".join(row) + " |" for row in rows]) + "\n"


def write_report(out):
    report = read(out / "report.json") or {}
    stages = sorted(report.items(), key=lambda item: item[1]["stage"])
    rows = [[f"{s['stage']} {name}", "ok" if s["ok"] else "failed", f"{s['seconds']:.0f}", s["summary"]] for name, s in stages]
    text = [table(["stage", "result", "seconds", "found"], rows)]
    found = lambda name: report.get(name, {}).get("found", {})
    ours, theirs = found("steps"), found("pytorch")
    rows = []
    for name in CASES:
        if name not in ours and name not in theirs:
            continue
        mine, torch = ours.get(name), theirs.get(name)
        step = torch["parts"]["step"] if torch else {}
        ms = mine["costs"]["step_ms"] if mine else None
        ratio = lambda side: number(step[side] / ms if ms and side in step else None, ".2f")
        device = mine and mine["memory"]
        rows.append([
            name, str((mine or torch)["vertices"]), number(ms, ".1f"), number(ms and 1e3 / ms, ".2f"),
            number(step.get("torch_ms"), ".1f"), ratio("torch_ms"),
            number(step.get("torch_tf32_ms"), ".1f"), ratio("torch_tf32_ms"),
            number(mine and mine["costs"]["peak_mib"]), number(device and device["peak_mib"] - device["before_mib"]),
            number(torch and torch["peak_mib"]["torch"]),
        ])
    if "paper-mean" in ours:
        mean = ours["paper-mean"]
        cells = [f"{mean['step_ms']:.1f}", f"{mean['steps_per_second']:.2f}"]
        rows.append(["paper, mean of M = 1 to 6", "", *cells] + [""] * 7)
    if rows:
        text.append("A training step. Ratios: PyTorch's time over ours. Device memory is what nvidia-smi sees besides what was in\n"
                    "use before; of PyTorch it is what its tensors take (on a processor: what the process takes).\n")
        text.append(table(["case", "vertices", "ours [ms]", "steps/s", "PyTorch f32 [ms]", "ratio", "TF32 [ms]", "ratio",
                           "host [MiB]", "device [MiB]", "PyTorch [MiB]"], rows))
    keys = {
        "forward": "forward_ms", "forward + backward": "forward_backward_ms", "step": "step_ms", "losses": "losses_ms",
        "drape again": "drape_ms",
    }
    rows = [
        [f"{name}, {part}", number(ours[name]["costs"][key] if name in ours else None, ".2f")]
        + [number(theirs[name]["parts"][part].get(side), ".2f") for side in ("torch_ms", "torch_tf32_ms")]
        for name in theirs for part, key in keys.items()
    ]
    if rows:
        text += ["Parts of it [ms].\n", table(["case, part", "ours", "PyTorch f32", "TF32"], rows)]
    profiles = found("profile")
    if profiles:
        parts = list(next(iter(profiles.values()))["shares_ms"])
        text.append("Where a step goes, M = 3 [ms]. Waiting for the device after every part makes the step a little slower.\n")
        text.append(table(["threads", "step", *parts], [
            [name, f"{p['step_ms']:.1f}", *(f"{p['shares_ms'][part]:.1f}" for part in parts)] for name, p in profiles.items()]))
    (out / "report.md").write_text("\n".join(text))
    print("\n".join(text[1:]), flush=True)
    return True


if __name__ == "__main__":
    arguments = sys.argv[1:]
    if arguments[:1] == ["stage"] and len(arguments) == 7:
        out, work = map(pathlib.Path, arguments[1:3])
        done = stage(out, work, int(arguments[3]), arguments[4], float(arguments[5]), int(arguments[6]))
    elif arguments[:1] == ["report"] and len(arguments) == 2:
        done = write_report(pathlib.Path(arguments[1]))
    else:
        raise SystemExit(__doc__)
    sys.exit(not done)

"""The tables of the renderer's speed and accuracy, as text for docs/results."""

from collections.abc import Callable

from tables_format import digits, link_to, markdown, power, results_of, source_of

WORKLOADS = {
    "A": "56 strokes, 4 views of 512²",
    "B": "1,024 strokes, 1 view of 1024²",
    "C": "56 strokes, 4 views of 64²",
    "D": "2,048 strokes, 1 view of 2040×1344",
}
GPU_WORKLOADS = WORKLOADS | {"E": "100,000 strokes, 1 view of 4096²"}
MACHINES = ("render", "render_epyc_slow", "render_avx2", "render_xeon")
BOTH = "forward + backward"


def speed() -> str:
    """Milliseconds of the renderer."""
    figures = results_of("render")["figures"]
    rows = []
    for key, name in WORKLOADS.items():
        one, two = (figures["ms"][key][threads] for threads in "12")
        rows += [[f"**{key}**: {name}", "forward", digits(one["forward"][0]), digits(two["forward"][0]),
                  digits(figures["reference_ms"][key]["forward"])],
                 ["", BOTH, digits(one[BOTH][0]), digits(two[BOTH][0]), digits(figures["reference_ms"][key][BOTH])],
                 ["", f"Monte Carlo, 2×2, {BOTH}", *(digits(t[f"Monte Carlo {BOTH}"][0]) for t in (one, two)), ""],
                 ["", "memory above the images, MB", digits(figures["memory_mb"][key]), "", ""]]  # fmt: skip
    return markdown(["workload", "ms of", "1 thread", "2 threads", "the reference in PyTorch"], rows) + source_of(
        "render"
    )


def machines() -> str:
    """The renderer and a bare kernel on several machines."""
    rows = []
    for file in MACHINES:
        read = results_of(file)
        about, ms = read["environment"], read["figures"]["ms"]
        for key in "ABC":
            times = ms[key]["1"]
            rows.append([f"{about['cpu']}, {about['instruction_set']}, {link_to(file)}" if key == "A" else "", key])
            for what in ("forward", BOTH):
                ours, bare = times[what][0], times[f"prototype {what}"][0]
                rows[-1] += [digits(ours), f"{digits(bare)} ({100 * bare / ours:.0f} %)"]
    head = ["machine, 1 thread", "", "forward, ms", "bare kernel", f"{BOTH}, ms", "bare kernel"]
    return markdown(head, rows)


def instruction_sets() -> str:
    """The renderer by each instruction set of one machine."""
    rows = []
    for key, times in results_of("instruction_sets")["figures"].items():
        copy = times["copy"][0]
        names = dict.fromkeys(way.split()[0] for way in times if way != "copy")
        for what, way in (("forward", "forward"), (BOTH, "both")):
            found = [times[f"{name} {way}"][0] for name in names]
            cells = [f"{digits(ms)} ({digits(ms / copy)})" if key in "AB" else digits(ms) for ms in found]
            rows.append([key if way == "forward" else "", what, *cells])
    return markdown(["", "ms (copies of the images)", *names], rows) + source_of("instruction_sets")


def step_cost() -> str:
    """What is not the prior in a step of distillation."""
    rows = [
        [
            name,
            digits(row["ms"][0]),
            f"{row['percent_of_published_step']:.2f}" if row["percent_of_published_step"] else "",
        ]
        for name, row in results_of("step_cost")["figures"].items()
    ]
    return markdown(["prior", "ms a step without the network", "% of the published time of a step"], rows) + source_of(
        "step_cost"
    )


def compile_cuda() -> str:
    """Seconds that NVRTC takes for the CUDA kernels."""
    figures = results_of("compile_cuda")["figures"]
    parts = list(next(iter(figures.values())))
    rows = [[part, *(f"{figures[sm][part]:.2f}" for sm in figures)] for part in parts]
    return markdown(["seconds for", *figures], rows) + source_of("compile_cuda")


def gpu() -> str:
    """Milliseconds of the renderer on an NVIDIA GPU."""
    figures = results_of("render_cuda")["figures"]
    rows = []
    for key, found in figures["workloads"].items():
        for pass_ in ("forward", "backward", "both"):
            times = [digits(found[f"{pass_}, {clock}"]) for clock in ("device", "user")]
            times.append(digits(found["both, one thread"]) if pass_ == "both" else "")
            first = pass_ == "forward"
            rows.append([f"**{key}**: {GPU_WORKLOADS[key]}" if first else "", pass_, *times,
                         f"{found[f'{pass_}, floor']:.3f}", digits(found["memory, MB"]) if first else ""])  # fmt: skip
    clocks = ["device, ms", "a call and a wait, ms", "in one thread, ms"]
    head = ["workload", "pass", *clocks, "floor, ms", "memory above the strokes, MB"]
    first, later = (figures["first"][name] for name in ("first call, s", "later process, s"))
    text = (
        f"A copy moves {figures['copy, TB/s']:.1f} TB/s, reading and writing. A first call takes {first:.2f} s where "
        f"nothing is compiled yet, {later:.2f} s in a later process."
    )
    return f"{markdown(head, rows)}\n{text}\n{source_of('render_cuda')}"


def gpu_step() -> str:
    """A step of distillation with a network of full size on an NVIDIA GPU."""
    figures = results_of("step_cost_cuda")["figures"]
    ways = ("step", "without the prior", "renderer")
    shares = (100.0, figures["percent without the prior"], figures["percent renderer"])
    rows = []
    for way, share in zip(ways, shares, strict=True):
        median, low, high = figures[f"{way}, ms"]
        rows.append([way, digits(median), f"{digits(low)} to {digits(high)}", f"{share:.1f}"])
    return markdown(["", "ms", "quartiles", "% of a step"], rows) + source_of("step_cost_cuda")


def agreement() -> str:
    """Pictures and gradients of the kernels and of the reference."""
    kernels = results_of("accuracy")["figures"]["kernels"]
    text = (
        f"Of {kernels['ink']:,} pixels with ink in {kernels['scenes']} random scenes, {100 * kernels['within']:.3f} % "
        f"are within 1e-4, and {100 * kernels['depth_within']:.2f} % of their depths. The worst pixel is off by "
        f"{max(pixel['error'] for pixel in kernels['worst']):.4f}.\n\n"
    )
    columns = list(kernels["gradients"])
    rows = [
        [
            f"`{name}`",
            *(
                power(kernels["gradients"][c][name]["error"]) if name in kernels["gradients"][c] else ""
                for c in columns
            ),
        ]
        for name in kernels["gradients"][columns[0]]
    ]
    return text + markdown(["relative error of the gradient to", *columns], rows) + source_of("accuracy")


def differences() -> str:
    """Gradients of the reference against finite differences."""
    rows = [
        [name, row["directions"], row["bent"], power(row["median"]), power(row["worst"])]
        for name, row in results_of("accuracy")["figures"]["gradients"].items()
    ]
    return markdown(["of / to", "directions", "left out: bent", "median error", "worst"], rows) + source_of("accuracy")


def pydiffvg() -> str:
    """diff3ds.pydiffvg next to DiffVG."""
    rows = []
    for name, times in results_of("pydiffvg")["figures"]["ms"].items():
        for way in ("forward", BOTH):
            medians = [digits(times[f"{module}, {way}"][0]) for module in ("DiffVG", "diff3ds")]
            rows.append([name if way == "forward" else "", way, *medians, digits(times[f"ratio, {way}"])])
    return markdown(["scene", "ms of", "DiffVG", "diff3ds", "times as fast"], rows) + source_of("pydiffvg")


def growth() -> str:
    """What each job takes at the usual size, at ten and at a hundred times that."""
    read = results_of("growth")["figures"]
    rows = []
    for name, job in read["jobs"].items():
        cells = [f"{r['size']:,}: {digits(r['processor'])} s, {digits(r['mb'])} MB" for r in job["rows"]]
        cells += [f"{size:,}: not in {read['limit']} s" for size in job["sizes"][len(cells) : len(cells) + 1]]
        exponent = "" if job["exponent"] is None else f"{job['exponent']:.2f}"
        rows.append([name, job["over"], *cells, *[""] * (3 - len(cells)), exponent])
    head = ["job", "over", "usual", "10 times", "100 times", "exponent"]
    return markdown(head, rows) + source_of("growth")


TABLES: tuple[Callable[[], str], ...] = (
    speed,
    machines,
    instruction_sets,
    step_cost,
    compile_cuda,
    gpu,
    gpu_step,
    agreement,
    differences,
    pydiffvg,
    growth,
)

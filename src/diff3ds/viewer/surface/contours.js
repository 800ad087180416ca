// The contours of a surface in a view: where its normals are at right angles to the line of sight, and creases at which
// it turns over. They are chords that follow on each other, as those of strokes.

// Chords of the contours, and for each how much farther from the eye what hides it must be, in the view's units. Some lie
// where a solid hides them by itself: then that is less than nothing.
function contoursOf(surface, camera, half, stroke) {
  const steps = stepsOf(surface, axesOf(camera), camera.orthographic);
  const chains = chainsOf(steps);
  const count = steps.slack.length;
  const [values, slack, first] = [new Float32Array(count * CHORD), new Float32Array(count), [0]];
  let made = 0;
  for (const chain of chains) {
    const hidden = evened(chain.map(({ step }) => steps.inside[step]), isClosed(chain, steps), surface.leastRun);
    chain.forEach(({ step, turned }, i) => {
      const ends = steps.ends.slice(6 * step, 6 * step + 6);
      const [a, b] = turned ? [3, 0] : [0, 3];
      values.set([...ends.slice(a, a + 3), ...ends.slice(b, b + 3), half, half, stroke], made * CHORD);
      slack[made++] = hidden[i] ? -1 : steps.slack[step];
    });
    first.push(made);
  }
  return { values, slack, first };
}

// Pieces of contours, one in each face or along a crease: their ends, 6 numbers each, the numbers of the places where
// these are, which pieces share, their slack and whether they lie inside.
function stepsOf(surface, axes, orthographic) {
  const { points, normals } = surface;
  const steps = { ends: [], nodes: [], slack: [], inside: [], numbers: new Map() };
  const facing = new Float32Array(points.length / 3);
  for (let i = 0; i < facing.length; i++) {
    for (let k = 0; k < 3; k++) {
      const sight = orthographic ? -axes.forward[k] : axes.eye[k] - points[3 * i + k];
      facing[i] += normals[3 * i + k] * sight;
    }
  }
  acrossFaces(surface, facing, axes, orthographic, steps);
  alongCreases(surface, facing, steps);
  return steps;
}

function acrossFaces({ points, faces, closed, rings }, facing, axes, orthographic, steps) {
  for (let f = 0; f < faces.length; f += 3) {
    const [i, j, k] = [faces[f], faces[f + 1], faces[f + 2]];
    const [a, b, c] = [facing[i] >= 0, facing[j] >= 0, facing[k] >= 0];
    if (a === b && b === c) continue;
    // The corner that is alone on its side comes first.
    const [one, other, third] = b === c ? [i, j, k] : a === c ? [j, k, i] : [k, i, j];
    const ends = [other, third].flatMap((end) => crossing(points, facing, one, end));
    const corners = [one, other, third].map((corner) => pointAt(points, corner));
    const sides = [minus(corners[1], corners[0]), minus(corners[2], corners[0])];
    const normal = unit(cross(...sides));
    const along = unit(minus(ends.slice(3), ends.slice(0, 3)));
    if (!normal || !along) continue;
    const nodes = [other, third].map((end) => numberOf(steps, Math.min(one, end), Math.max(one, end)));
    // How wide the face is across the contour.
    const across = cross(normal, along);
    const [low, high] = [Math.min, Math.max].map((pick) => pick(0, ...sides.map((side) => dot(side, across))));
    addStep(steps, ends, nodes, rings * (high - low), closed && !bendsAway(corners, sides, [one, other, third].map((p) => facing[p]), axes, orthographic));
  }
}

// Where the sign changes between two corners, the same to the last bit from both sides.
function crossing(points, facing, one, other) {
  const [a, b] = one < other ? [one, other] : [other, one];
  return mixed(pointAt(points, a), pointAt(points, b), facing[a] / (facing[a] - facing[b]));
}

// Whether the normal turns towards the camera on the way to it: on a ball it does, in a bowl it does not.
function bendsAway(corners, [one, other], facing, axes, orthographic) {
  const middle = [0, 1, 2].map((i) => (corners[0][i] + corners[1][i] + corners[2][i]) / 3);
  const sight = orthographic ? axes.forward.map((value) => -value) : minus(axes.eye, middle);
  const [a, b, c, x, y] = [dot(one, one), dot(one, other), dot(other, other), dot(one, sight), dot(other, sight)];
  return (c * x - b * y) * (facing[1] - facing[0]) + (a * y - b * x) * (facing[2] - facing[0]) >= 0;
}

// Where one side of a crease is turned to the camera and the other is not: its whole length, or a part.
function alongCreases({ points, creases, places, convex, closed }, facing, steps) {
  for (let crease = 0; crease < creases.length; crease += 4) {
    const sides = [0, 2].map((side) => [0, 1].map((end) => facing[creases[crease + side + end]]));
    const cuts = sides.map(([a, b]) => (a >= 0 !== b >= 0 ? a / (a - b) : 1)).sort((a, b) => a - b);
    const stops = [0, ...cuts, 1];
    const [from, to] = [0, 1].map((end) => creases[crease + end]);
    for (let i = 0; i < 3; i++) {
      const [start, end] = [stops[i], stops[i + 1]];
      const [one, other] = sides.map(([a, b]) => a + ((b - a) * (start + end)) / 2 >= 0);
      if (!(end > start) || one === other) continue;
      const ends = [start, end].flatMap((t) => mixed(pointAt(points, from), pointAt(points, to), t));
      // Ends of creases meet at corners, whichever side of them is meant; others meet nothing.
      const nodes = [start, end].map((t) => (t % 1 ? numberOf(steps, -2, crease + t) : numberOf(steps, -1, places[t ? to : from])));
      addStep(steps, ends, nodes, 0, closed && crease / 4 >= convex);
    }
  }
}

function addStep(steps, ends, nodes, slack, inside) {
  steps.ends.push(...ends);
  steps.nodes.push(...nodes);
  steps.slack.push(slack);
  steps.inside.push(inside);
}

// A number for each pair, in the order in which they come.
function numberOf({ numbers }, one, other) {
  const key = (one + 2) * 2 ** 26 + other;
  if (!numbers.has(key)) numbers.set(key, numbers.size);
  return numbers.get(key);
}

// Runs of steps that follow on each other; a step is turned where it is gone along from its second end.
function chainsOf({ nodes, numbers }) {
  const at = Array.from({ length: numbers.size }, () => []);
  nodes.forEach((node, i) => at[node].push(i >> 1));
  const seen = new Uint8Array(nodes.length / 2);
  const walk = (node) => {
    const chain = [];
    for (;;) {
      const step = at[node].find((each) => !seen[each]);
      if (step === undefined) return chain;
      seen[step] = 1;
      const turned = nodes[2 * step] !== node;
      chain.push({ step, turned });
      node = nodes[2 * step + (turned ? 0 : 1)];
    }
  };
  const every = at.map((_, node) => node);
  const begins = [...every.filter((node) => at[node].length === 1), ...every];
  return begins.map(walk).filter((chain) => chain.length);
}

// Whether a chain comes back to where it begins.
function isClosed(chain, { nodes }) {
  const [first, last] = [chain[0], chain[chain.length - 1]];
  return nodes[2 * first.step + (first.turned ? 1 : 0)] === nodes[2 * last.step + (last.turned ? 0 : 1)];
}

// Flags along a chain without runs of fewer than `least` steps, as the package evens them out (curves/even_out.py): the
// shortest run, of equals the first, becomes one with its neighbours, until none is too short.
function evened(flags, closed, least) {
  const even = [...flags];
  for (;;) {
    const runs = [];
    even.forEach((flag, i) => (i && flag === even[i - 1] ? runs[runs.length - 1].push(i) : runs.push([i])));
    if (closed && runs.length > 1 && even[0] === even[even.length - 1]) runs[0].push(...runs.pop());
    const shortest = Math.min(...runs.map((run) => run.length));
    if (runs.length < 2 || shortest >= least) return even;
    for (const i of runs.find((run) => run.length === shortest)) even[i] = !even[i];
  }
}

// How long strokes are in the picture before each of their chords begins, pixels.
function lengthsBefore({ values, first }, camera, size) {
  const axes = axesOf(camera);
  const [near] = depthsOf(camera);
  const lengths = new Float32Array(values.length / CHORD);
  const pixel = (i) => {
    const { x, y, depth } = projected(camera, axes, size, [values[i], values[i + 1], values[i + 2]]);
    return depth > near ? [x, y] : null;
  };
  for (let stroke = 0; stroke + 1 < first.length; stroke++) {
    let total = 0;
    for (let chord = first[stroke]; chord < first[stroke + 1]; chord++) {
      lengths[chord] = total;
      const [a, b] = [pixel(chord * CHORD), pixel(chord * CHORD + 3)];
      if (a && b) total += distance(a, b);
    }
  }
  return lengths;
}

// Vectors as lists of numbers.

function plus(a, b, scale = 1) {
  return a.map((value, axis) => value + scale * b[axis]);
}

function minus(a, b) {
  return plus(a, b, -1);
}

function dot(a, b) {
  return a.reduce((sum, value, axis) => sum + value * b[axis], 0);
}

function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

function unit(a) {
  const length = Math.hypot(...a);
  return length > 0 ? a.map((value) => value / length) : null;
}

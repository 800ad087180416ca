// The camera: it goes round a target, z up, as `orbit` and `framed` of the package have it. Lengths are in radii.

const RADIANS = Math.PI / 180;
// Of the distance at which the camera starts: nearer than this nothing is drawn, as in `framed`.
const NEAR = 0.01;
// The sketch's ball has radius 1; a little more for rounding.
const BALL = 1.01;

// Where the camera begins: the sketch fills the shorter side of the picture.
function startCamera(start, [width, height]) {
  const side = Math.tan((start.fov / 2) * RADIANS) * Math.min(1, width / height);
  const distance = 1 / (start.filled * Math.sin(Math.atan(side)));
  const { azimuth, elevation, fov } = start;
  const fixed = { fov, near: NEAR * distance, reach: reachOf(start) };
  return { azimuth, elevation, distance, ...fixed, target: [0, 0, 0], orthographic: false };
}

// How far what is drawn reaches from the middle: the sketch's ball, or a surface that is larger.
function reachOf(start) {
  return Math.max(start.reach ?? 1, 1) * BALL;
}

// Right, up and forward of the camera in the world, and its place.
function axesOf({ azimuth, elevation, distance, target }) {
  const [a, e] = [azimuth * RADIANS, elevation * RADIANS];
  const outward = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)];
  return {
    right: [-Math.sin(a), Math.cos(a), 0],
    up: [-Math.sin(e) * Math.cos(a), -Math.sin(e) * Math.sin(a), Math.cos(e)],
    forward: outward.map((value) => -value),
    eye: target.map((value, axis) => value + distance * outward[axis]),
  };
}

// Pixels of a unit of length at depth 1; of an orthographic camera at any depth, such that the target keeps its size.
function focalOf(camera, height) {
  const focal = height / 2 / Math.tan((camera.fov / 2) * RADIANS);
  return camera.orthographic ? focal / camera.distance : focal;
}

// Depths between which all of the sketch lies that is drawn. Without perspective nothing is too near.
function depthsOf(camera) {
  const aside = Math.hypot(...camera.target) + camera.reach;
  const near = camera.distance - aside;
  return [camera.orthographic ? near : Math.max(near, camera.near), Math.max(camera.distance + aside, 2 * camera.near)];
}

// How many pixels a unit of length takes at most in a ball, from wherever the camera goes round.
function pixelsAtMost(camera, height, middle, radius) {
  const focal = focalOf(camera, height);
  if (camera.orthographic) return focal;
  return focal / Math.max(camera.distance - distance(middle, camera.target) - radius, camera.near);
}

// The same view where the sketch is moved and scaled to another ball.
function sameView(camera, was, now) {
  const scale = was.radius / now.radius;
  const target = camera.target.map((value, axis) => value * scale + (was.middle[axis] - now.middle[axis]) / now.radius);
  return { ...camera, target, distance: camera.distance * scale, near: camera.near * scale, reach: reachOf(now) };
}

// The direction of what is seen in a pixel, and where it comes from.
function rayAt(camera, axes, [width, height], x, y) {
  const focal = focalOf(camera, height);
  const [right, down] = [(x - width / 2) / focal, (y - height / 2) / focal];
  const aside = axes.right.map((value, i) => value * right - axes.up[i] * down);
  if (camera.orthographic) return { from: axes.eye.map((value, i) => value + aside[i]), along: axes.forward };
  return { from: axes.eye, along: axes.forward.map((value, i) => value + aside[i]) };
}

function turned(camera, azimuth, elevation) {
  const high = Math.min(Math.max(camera.elevation + elevation, -90), 90);
  return { ...camera, azimuth: (((camera.azimuth + azimuth + 180) % 360) + 360) % 360 - 180, elevation: high };
}

function zoomed(camera, factor) {
  return { ...camera, distance: Math.min(Math.max(camera.distance / factor, 2 * camera.near), 1000) };
}

// The sketch moves by so many pixels to the right and down.
function panned(camera, right, down, height) {
  const scale = (camera.orthographic ? 1 : camera.distance) / focalOf(camera, height);
  const axes = axesOf(camera);
  const target = camera.target.map((value, i) => value - scale * (right * axes.right[i] - down * axes.up[i]));
  return { ...camera, target };
}

// The pixel of a point, and its depth.
function projected(camera, axes, [width, height], point) {
  const offset = point.map((value, axis) => value - axes.eye[axis]);
  const along = (direction) => direction.reduce((sum, value, axis) => sum + value * offset[axis], 0);
  const depth = along(axes.forward);
  const scale = focalOf(camera, height) / (camera.orthographic ? 1 : depth);
  return { x: width / 2 + scale * along(axes.right), y: height / 2 - scale * along(axes.up), depth, scale };
}

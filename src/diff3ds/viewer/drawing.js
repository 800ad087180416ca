// Draws chords with WebGL2: every picture is the mean of many with one sample a pixel, each with a depth buffer.
//
// A sample is covered by a stroke if it lies nearer to the centre line than the half width. The nearest stroke wins, the
// last of equals. A stroke of opacity a is there in the share a of the pictures, in another order in each pixel, so
// that strokes behind others are seen through them as compositing by depth says. What is behind a surface is decided for
// the nearest place of the centre line, so that a wide stroke on a surface is not cut by it.

// Pictures whose mean is shown at last: a power of two, for the permutation in the shader.
const SAMPLES = 64;

// What the shader knows of each chord.
const ATTRIBUTES = ["start", "end", "rest", "slack", "before"];
// Opacity of faint lines, as a share of that of visible ones; dashes and the gaps between their round ends, as shares of
// the picture's height. As in the package (surfaces/draw.py, dashes.py).
const [FAINT, DASH, GAP] = [0.25, 0.009, 0.006];

const STROKES = {
  vertex: `#version 300 es
    precision highp float;
    in vec3 start, end;
    in vec3 rest;  // half widths at both ends, stroke
    in float slack, before;  // how much nearer what hides it must be; px of the stroke before this chord
    uniform mat3 axes;  // columns: right, down, forward
    uniform vec3 eye;
    uniform vec2 size, depths;
    uniform float focal, halo;
    uniform bool orthographic, world;
    uniform sampler2D inks;
    flat out vec4 ends, radii, ink;  // radii: px, and depths of the buffer
    flat out vec3 hiding;  // depths of the buffer at both ends that a surface is compared with, and before
    flat out uint stroke;
    vec2 pixel(vec3 p) { return size / 2. + focal * p.xy / (orthographic ? 1. : p.z); }
    float radius(float width, float z) {
      return halo + (world ? width * focal / (orthographic ? 1. : z) : width * size.y);
    }
    float depth(float z) {
      vec2 d = depths;
      return orthographic ? (z - d.x) / (d.y - d.x) : (1. / d.x - 1. / z) / (1. / d.x - 1. / d.y);
    }
    void main() {
      stroke = uint(rest.z);
      ink = texelFetch(inks, ivec2(int(rest.z) % 1024, int(rest.z) / 1024), 0);
      vec3 a = (start - eye) * axes, b = (end - eye) * axes;
      vec2 width = rest.xy;
      float near = depths.x;
      gl_Position = vec4(2., 2., 2., 1.);
      if (ink.a == 0. || max(a.z, b.z) <= near) return;
      float cut = (near - a.z) / (b.z - a.z);
      if (a.z < near) { a = mix(a, b, cut); width.x = mix(width.x, width.y, cut); }
      else if (b.z < near) { b = mix(a, b, cut); width.y = mix(width.x, width.y, cut); }
      ends = vec4(pixel(a), pixel(b));
      radii = vec4(radius(width.x, a.z), radius(width.y, b.z), depth(a.z), depth(b.z));
      // Less than no slack: a solid hides this by itself.
      vec2 slacks = max(vec2(a.z, b.z) - slack, vec2(near));
      hiding = vec3(slack < 0. ? vec2(2.) : vec2(depth(slacks.x), depth(slacks.y)), before);
      vec2 along = ends.zw - ends.xy;
      along = length(along) > 1e-6 ? normalize(along) : vec2(1., 0.);
      float reach = max(radii.x, radii.y) + 1.;
      vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2. - 1.;
      vec2 p = (corner.x < 0. ? ends.xy : ends.zw) + reach * (corner.x * along + corner.y * vec2(-along.y, along.x));
      gl_Position = vec4((p / size * 2. - 1.) * vec2(1., -1.), 0., 1.);
    }`,
  fragment: `#version 300 es
    precision highp float;
    flat in vec4 ends, radii, ink;
    flat in vec3 hiding;
    flat in uint stroke;
    uniform vec2 size, offset, dashes;  // dashes: px of one, and of the gap behind it
    uniform int hidden;  // what becomes of hidden lines: 0 they are shown, 1 faint, 2 dashed, 3 dropped
    uniform sampler2D front;
    uniform float halo;
    uniform uint picture;
    uniform vec3 accent;
    out vec4 color;
    uint hash(uint x) {  // "lowbias32" of C. Wellons
      x ^= x >> 16; x *= 0x7feb352du; x ^= x >> 15; x *= 0x846ca68bu;
      return x ^ (x >> 16);
    }
    float place() {  // of this picture in an order of all that belongs to the stroke in this pixel, 0 to 1
      uvec2 p = uvec2(gl_FragCoord.xy);
      uint h = hash(stroke + hash(p.x + hash(p.y))), j = picture;
      j = (j * (h | 1u) + (h >> 6)) & ${SAMPLES - 1}u;
      j ^= j >> 3;
      j = (j * ((h >> 12) | 1u) + (h >> 18)) & ${SAMPLES - 1}u;
      j ^= j >> 2;
      return (float(j) + .5) / ${SAMPLES}.;
    }
    bool behind(vec2 p, float s) {
      ivec2 texel = clamp(ivec2(p.x, size.y - p.y), ivec2(0), ivec2(size) - 1);
      return mix(hiding.x, hiding.y, s) > texelFetch(front, texel, 0).r;
    }
    void main() {
      vec2 p = vec2(gl_FragCoord.x, size.y - gl_FragCoord.y) + offset - ends.xy, along = ends.zw - ends.xy;
      float s = clamp(dot(p, along) / max(dot(along, along), 1e-12), 0., 1.);
      float away = distance(p, s * along), radius = mix(radii.x, radii.y, s), opacity = ink.a;
      if (away >= radius) discard;
      if (halo == 0. && hidden > 0 && behind(ends.xy + s * along, s)) {
        if (hidden == 3) discard;
        if (hidden == 1) opacity *= ${FAINT};
        float gap = mod(hiding.z + s * length(along), dashes.x + dashes.y) - dashes.x;
        if (hidden == 2 && gap > 0. && length(vec2(min(gap, dashes.y - gap), away)) >= radius) discard;
      }
      if (halo == 0. && place() >= opacity) discard;
      color = vec4(halo > 0. ? accent : ink.rgb, 1.);
      gl_FragDepth = halo > 0. ? .999999 : (radii.z + s * (radii.w - radii.z)) * .99999;  // equal ends: exactly that
    }`,
};

const COPY = {
  vertex: `#version 300 es
    void main() { gl_Position = vec4(gl_VertexID == 1 ? 3. : -1., gl_VertexID == 2 ? 3. : -1., 0., 1.); }`,
  fragment: `#version 300 es
    precision highp float;
    uniform sampler2D picture;
    out vec4 color;
    void main() { color = vec4(texelFetch(picture, ivec2(gl_FragCoord.xy), 0).rgb, 1.); }`,
};

// What draws on a canvas, or null where the browser has no WebGL2 that adds up pictures.
function makeDrawing(canvas) {
  const gl = canvas.getContext("webgl2", { antialias: false, depth: false, alpha: false });
  if (!gl || !(gl.getExtension("EXT_color_buffer_float") || gl.getExtension("EXT_color_buffer_half_float"))) return null;
  const strokes = program(gl, STROKES, ATTRIBUTES);
  const copy = program(gl, COPY, []);
  const [chords, contours] = [makeChords(gl), makeChords(gl)];
  const inks = gl.createTexture();
  let targets = null;
  let [surface, gap] = [null, 0];

  // Null where there is none.
  function setSurface(other) {
    if (other) (surface ??= makeSurfaceDepth(gl)).setSurface(other);
    else surface = null;
  }

  // Before the first picture of a view with a surface: its contours there, and where strokes are dashed, their lengths,
  // and the gap between the round ends of dashes, pixels.
  function setView(camera, made, before, between) {
    gap = between;
    fitTargets();
    surface.draw(camera, targets.width, targets.height);
    contours.set(made);
    contours.setBefore(made.before);
    chords.setBefore(before);
  }

  // One RGBA a stroke; opacity 0 hides it.
  function setInks(values) {
    const rows = Math.max(Math.ceil(values.length / 1024), 1);
    const texels = new Float32Array(rows * 1024 * 4);
    values.forEach((ink, i) => texels.set(ink, 4 * i));
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, inks);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, 1024, rows, 0, gl.RGBA, gl.FLOAT, texels);
    plain(gl);
  }

  function fitTargets() {
    const [width, height] = [canvas.width, canvas.height];
    if (targets?.width === width && targets.height === height) return;
    if (targets) [targets.one, targets.mean].forEach((target) => target.discard());
    targets = { width, height, one: target(gl, gl.RGBA8, width, height), mean: target(gl, gl.RGBA16F, width, height) };
  }

  // One picture, its samples moved within their pixels by the additive sequence with the plastic number.
  function drawOne(index, scene) {
    const at = strokes.at;
    gl.bindFramebuffer(gl.FRAMEBUFFER, targets.one.frame);
    gl.viewport(0, 0, targets.width, targets.height);
    gl.clearColor(...scene.ground, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.disable(gl.BLEND);
    gl.useProgram(strokes.program);
    gl.uniform1i(at("inks"), 1);
    setCamera(gl, at, scene.camera, [targets.width, targets.height]);
    gl.uniform1i(at("world"), scene.world);
    gl.uniform2f(at("offset"), ((0.5 + 0.7548776662 * index) % 1) - 0.5, ((0.5 + 0.5698402909 * index) % 1) - 0.5);
    gl.uniform1ui(at("picture"), index);
    gl.uniform3f(at("accent"), ...scene.accent);
    gl.uniform1i(at("hidden"), surface ? scene.hidden : 0);
    gl.uniform1i(at("front"), surface ? 2 : 1);
    gl.uniform2f(at("dashes"), DASH * targets.height, gap);
    gl.uniform1f(at("halo"), 0);
    chords.draw();
    if (surface) contours.draw();
    gl.uniform1f(at("halo"), scene.haloPixels);
    for (const stroke of scene.chosen) chords.draw(stroke);
  }

  function copyTo(frame, from) {
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.disable(gl.DEPTH_TEST);
    gl.useProgram(copy.program);
    gl.uniform1i(copy.at("picture"), 0);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, from.texture);
    ATTRIBUTES.forEach((_, i) => gl.disableVertexAttribArray(i));
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  // Adds the pictures from..to to the mean and shows it.
  function show(from, to, scene) {
    fitTargets();
    for (let index = from; index < to; index++) {
      drawOne(index, scene);
      gl.enable(gl.BLEND);
      gl.blendColor(0, 0, 0, 1 / (index + 1));
      gl.blendFunc(gl.CONSTANT_ALPHA, gl.ONE_MINUS_CONSTANT_ALPHA);
      copyTo(targets.mean.frame, targets.one);
    }
    gl.disable(gl.BLEND);
    copyTo(null, targets.mean);
  }

  return { setChords: chords.set, setInks, setSurface, setView, show };
}

// Chords that are drawn, all or those of one stroke. Slack and lengths before are 0 where there are none.
function makeChords(gl) {
  const [values, slack, before] = [gl.createBuffer(), gl.createBuffer(), gl.createBuffer()];
  let [first, hasSlack, hasBefore] = [[0], false, false];

  function fill(buffer, numbers) {
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    if (numbers) gl.bufferData(gl.ARRAY_BUFFER, numbers, gl.DYNAMIC_DRAW);
    return Boolean(numbers);
  }

  function set(made) {
    first = made.first;
    fill(values, made.values);
    hasSlack = fill(slack, made.slack);
    hasBefore = false;
  }

  function setBefore(lengths) {
    hasBefore = fill(before, lengths);
  }

  function attribute(index, count, stride, offset) {
    gl.enableVertexAttribArray(index);
    gl.vertexAttribPointer(index, count, gl.FLOAT, false, stride * 4, offset * 4);
    gl.vertexAttribDivisor(index, 1);
  }

  function draw(stroke = null) {
    const [from, to] = stroke === null ? [0, first.at(-1)] : [first[stroke], first[stroke + 1]];
    if (!(to > from)) return;
    gl.bindBuffer(gl.ARRAY_BUFFER, values);
    for (let i = 0; i < 3; i++) attribute(i, 3, CHORD, from * CHORD + 3 * i);
    [[slack, hasSlack], [before, hasBefore]].forEach(([buffer, there], i) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      if (there) {
        attribute(3 + i, 1, 1, from);
      } else {
        gl.disableVertexAttribArray(3 + i);
        gl.vertexAttrib1f(3 + i, 0);
      }
    });
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, to - from);
  }

  return { set, setBefore, draw };
}

function setCamera(gl, at, camera, size) {
  const { right, up, forward, eye } = axesOf(camera);
  gl.uniformMatrix3fv(at("axes"), false, [...right, ...up.map((value) => -value), ...forward]);
  gl.uniform3f(at("eye"), ...eye);
  gl.uniform2f(at("size"), ...size);
  gl.uniform2f(at("depths"), ...depthsOf(camera));
  gl.uniform1f(at("focal"), focalOf(camera, size[1]));
  gl.uniform1i(at("orthographic"), camera.orthographic);
}

function program(gl, source, attributes) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, source.vertex], [gl.FRAGMENT_SHADER, source.fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  attributes.forEach((name, i) => gl.bindAttribLocation(made, i, name));
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS) && !gl.isContextLost()) {
    const logs = gl.getAttachedShaders(made).map((shader) => gl.getShaderInfoLog(shader));
    throw new Error(`the shaders are refused: ${[gl.getProgramInfoLog(made), ...logs].join(" ")}`);
  }
  const places = new Map();
  const at = (name) => {
    if (!places.has(name)) places.set(name, gl.getUniformLocation(made, name));
    return places.get(name);
  };
  return { program: made, at };
}

// A texture to draw on, with a depth buffer.
function target(gl, format, width, height) {
  const [texture, frame, depth] = [gl.createTexture(), gl.createFramebuffer(), gl.createRenderbuffer()];
  gl.activeTexture(gl.TEXTURE0);
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
  plain(gl);
  gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  gl.bindRenderbuffer(gl.RENDERBUFFER, depth);
  gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, width, height);
  gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
  const discard = () => {
    gl.deleteTexture(texture);
    gl.deleteFramebuffer(frame);
    gl.deleteRenderbuffer(depth);
  };
  return { texture, frame, discard };
}

function plain(gl) {
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
}

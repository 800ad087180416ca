// The depth of a surface in each pixel of a view, as a texture.
//
// What lies on the surface is not hidden by it. So each triangle is drawn where a point that is `near` behind its plane
// would be seen, and half the diagonal of a pixel more, since depths are those of the middles of pixels: the slope of
// the triangle takes care of itself.

const SURFACE = {
  vertex: `#version 300 es
    precision highp float;
    in vec3 point;
    uniform mat3 axes;
    uniform vec3 eye;
    uniform vec2 size, depths;
    uniform float focal;
    uniform bool orthographic;
    out vec3 seen;
    void main() {
      seen = (point - eye) * axes;
      float w = orthographic ? 1. : seen.z;
      float z = orthographic ? (seen.z - depths.x) / (depths.y - depths.x) : (seen.z / depths.x - 1.) / (1. / depths.x - 1. / depths.y);
      gl_Position = vec4(2. * focal * seen.xy / size * vec2(1., -1.), 2. * z - w, w);
    }`,
  fragment: `#version 300 es
    precision highp float;
    in vec3 seen;
    uniform vec2 depths;
    uniform float focal, near;
    uniform bool orthographic;
    void main() {
      vec3 normal = cross(dFdx(seen), dFdy(seen));
      float slack = near + .70711 / focal * (orthographic ? 1. : seen.z);
      // How much farther along the line of sight a point lies that is so far behind the plane.
      float sight = abs(dot(normal, orthographic ? vec3(0., 0., 1.) : seen / seen.z)) / max(length(normal), 1e-30);
      float z = seen.z + slack / max(sight, 1e-6);
      vec2 d = depths;
      gl_FragDepth = clamp(orthographic ? (z - d.x) / (d.y - d.x) : (1. / d.x - 1. / z) / (1. / d.x - 1. / d.y), 0., 1.);
    }`,
};

// What draws such depths: setSurface takes the surface, draw the camera and the size of the picture.
function makeSurfaceDepth(gl) {
  const made = program(gl, SURFACE, ["point"]);
  const [points, faces] = [gl.createBuffer(), gl.createBuffer()];
  let [surface, texture, frame, size] = [null, null, null, []];

  function setSurface(other) {
    surface = other;
    gl.bindBuffer(gl.ARRAY_BUFFER, points);
    gl.bufferData(gl.ARRAY_BUFFER, surface.points, gl.STATIC_DRAW);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, faces);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, surface.faces, gl.STATIC_DRAW);
  }

  function fit(width, height) {
    if (size[0] === width && size[1] === height) return;
    size = [width, height];
    gl.deleteTexture(texture);
    gl.deleteFramebuffer(frame);
    [texture, frame] = [gl.createTexture(), gl.createFramebuffer()];
    gl.activeTexture(gl.TEXTURE2);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.DEPTH_COMPONENT24, width, height);
    plain(gl);
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, texture, 0);
  }

  function draw(camera, width, height) {
    fit(width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.viewport(0, 0, width, height);
    gl.enable(gl.DEPTH_TEST);
    gl.disable(gl.BLEND);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.useProgram(made.program);
    setCamera(gl, made.at, camera, size);
    gl.uniform1f(made.at("near"), surface.near);
    gl.bindBuffer(gl.ARRAY_BUFFER, points);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.vertexAttribDivisor(0, 0);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, faces);
    const kind = surface.faces instanceof Uint32Array ? gl.UNSIGNED_INT : gl.UNSIGNED_SHORT;
    gl.drawElements(gl.TRIANGLES, surface.faces.length, kind, 0);
    gl.disableVertexAttribArray(0);
  }

  return { setSurface, draw };
}

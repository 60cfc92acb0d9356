// The report's interactive view: plain WebGL2, no library, nothing fetched from anywhere.
//
// Reads the JSON in #scene and the packed blocks beside it (made by view_data.py, which says how
// they are packed), draws design, stock, paths and cutter, and replays the simulated stock.
// Lengths are millimetres in part coordinates; deviation is positive where material is left.
// Where the report knows the machine (machine.js), its links move, and the world is either the part's or the machine's bed.

(() => {

// ---------------------------------------------------------------- small vector algebra

const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const addScaled = (a, b, s) => [a[0] + b[0] * s, a[1] + b[1] * s, a[2] + b[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const mix = (a, b, s) => [0, 1, 2].map(k => a[k] + (b[k] - a[k]) * s);
const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

// Column-major 4x4 of a row-major rotation (nine numbers) and an origin.
function placement(rotation, origin) {
  const r = rotation;
  return new Float32Array([r[0], r[3], r[6], 0, r[1], r[4], r[7], 0, r[2], r[5], r[8], 0, ...origin, 1]);
}

// Row-major rotation times vector, and its inverse.
const turnOut = (r, v) => [0, 1, 2].map(k => r[3 * k] * v[0] + r[3 * k + 1] * v[1] + r[3 * k + 2] * v[2]);
const turnInto = (r, v) => [0, 1, 2].map(k => r[k] * v[0] + r[3 + k] * v[1] + r[6 + k] * v[2]);

// WCS of a setup <-> part coordinates.
const fromWcs = (setup, p) => addScaled(turnOut(setup.rotation, p), setup.origin, 1);
const toWcs = (setup, p) => turnInto(setup.rotation, subtract(p, setup.origin));

// ---------------------------------------------------------------- page elements and state

const byId = id => document.getElementById(id);
const scene = JSON.parse(byId("scene").textContent);
const canvas = byId("canvas");

const machine = scene.machine;        // null: three axes without bodies
const LOADED = new Map();             // setup number -> promise of its program, decoded when first shown
const READY = new Map();              // setup number -> {path, replay, tools, motion}

const state = {
  setup: 0,
  fraction: 1,          // of the program's time
  playing: false,
  speed: 60,            // seconds of program per second of watching
  surface: "stock",     // "stock", "rest" (stock by material left), "design", "deviation"
  paths: "none",        // "all", "done", "none"
  pathColour: "operation",
  rapids: true, edges: true, stockEdges: false, fixtures: false, cutter: true, pins: true,
  stands: "part",       // what stands still: "part", "machine"
  bodies: false, seeThrough: false,     // of the machine
  region: "work",       // looked at: "work", "machine"
  scaleUm: 10,
  yaw: 0, pitch: 0, target: [0, 0, 0], halfHeight: 50,
};

let gl, programs, design, current, machineParts = { bodies: [], tools: new Map() }, isDirty = true;

// ---------------------------------------------------------------- packed blocks

// base64 -> gunzip -> ArrayBuffer; the text leaves the page to free its memory.
async function unpackBlock(name) {
  const element = byId("block-" + name);
  const text = element.textContent.trim();
  element.remove();
  const packed = Uint8Array.from(atob(text), c => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new BlockReader(await new Response(stream).arrayBuffer());
}

class BlockReader {
  constructor(buffer) { this.buffer = buffer; this.offset = 0; }

  // The next `count` numbers; arrays are padded to four bytes.
  take(Type, count) {
    const array = new Type(this.buffer, this.offset, count);
    this.offset += (array.byteLength + 3) & ~3;
    return array;
  }

  // The same, stored as differences to the number before.
  takeDelta(Type, count) {
    const array = this.take(Type, count);
    for (let i = 1; i < count; i++) array[i] += array[i - 1];
    return array;
  }
}

// Three columns of 0..65535 inside a box -> interleaved points.
function takePoints(reader, count, low, size) {
  const points = new Float32Array(3 * count);
  for (let k = 0; k < 3; k++) {
    const column = reader.takeDelta(Uint16Array, count);
    for (let i = 0; i < count; i++) points[3 * i + k] = low[k] + column[i] / 65535 * size[k];
  }
  return points;
}

// Octahedral pairs -> interleaved unit vectors.
function takeNormals(reader, count) {
  const u = reader.takeDelta(Int16Array, count), v = reader.takeDelta(Int16Array, count);
  const normals = new Float32Array(3 * count);
  for (let i = 0; i < count; i++) {
    let x = u[i] / 32767, y = v[i] / 32767;
    const z = 1 - Math.abs(x) - Math.abs(y), fold = Math.max(-z, 0);
    x += x >= 0 ? -fold : fold;
    y += y >= 0 ? -fold : fold;
    const length = Math.hypot(x, y, z) || 1;
    normals.set([x / length, y / length, z / length], 3 * i);
  }
  return normals;
}

// ---------------------------------------------------------------- shaders

const SHADER_HEAD = `#version 300 es
precision highp float; precision highp int; precision highp sampler2D;
`;

// Two lights that stay with the eye, the same from both sides; blue - pale - red for deviation.
const SHADER_COLOURS = `
vec3 lit(vec3 normal, vec3 colour) {
  vec3 n = normal.z < 0.0 ? -normal : normal;
  vec3 key = normalize(vec3(0.35, 0.55, 0.75)), fill = normalize(vec3(-0.7, 0.1, 0.5));
  float diffuse = 0.46 + 0.44 * max(dot(n, key), 0.0) + 0.18 * max(dot(n, fill), 0.0) + 0.12 * n.z;
  float shine = pow(max(dot(n, normalize(key + vec3(0, 0, 1))), 0.0), 40.0);
  return colour * diffuse + 0.14 * shine;
}
vec3 deviationColour(float share) {          // share of the scale, -1 gouge .. +1 material left
  vec3 pale = vec3(0.91, 0.93, 0.89);
  if (share <= -1.0) return vec3(0.07, 0.16, 0.42);
  if (share >= 1.0) return vec3(0.40, 0.03, 0.05);
  return share < 0.0 ? mix(pale, vec3(0.13, 0.40, 0.78), -share) : mix(pale, vec3(0.85, 0.16, 0.12), share);
}
`;

const SHADERS = {
  // Design and cutter: shaded triangles, plain or by deviation; what was not judged is grey.
  surface: [`
    in vec3 position; in vec3 normal; in float deviation; in float judged;
    uniform mat4 clip, place; uniform mat3 eye;
    out vec3 seenNormal; out float deviationUm, isJudged;
    void main() {
      seenNormal = eye * mat3(place) * normal;
      deviationUm = deviation; isJudged = judged;
      gl_Position = clip * place * vec4(position, 1.0);
    }`, SHADER_COLOURS + `
    in vec3 seenNormal; in float deviationUm, isJudged;
    uniform vec3 colour; uniform float scaleUm, opacity; uniform bool byDeviation;
    out vec4 pixel;
    void main() {
      vec3 base = colour;
      if (byDeviation) base = isJudged < 0.999 ? vec3(0.62) : deviationColour(deviationUm / scaleUm);
      pixel = vec4(lit(normalize(seenNormal), base), opacity);
    }`],

  // Stock: no vertex data at all, every vertex finds its node of the z-map from its number.
  // part 0: top, one strip a row; part 1: the four sides, one strip each; part 2: bottom.
  // Where the height has come down to the bottom nothing stands: neither top nor bottom is drawn.
  stock: [`
    uniform mat4 clip, place; uniform mat3 eye;
    uniform sampler2D heights, designTop;
    uniform ivec2 count; uniform vec2 origin; uniform float pitch, bottom, top; uniform int part;
    out vec3 seenNormal; out float leftUm, isCut, isJudged, standsMm; out vec2 at;
    float heightAt(ivec2 node) { return texelFetch(heights, clamp(node, ivec2(0), count - 1), 0).r; }
    void main() {
      int along = gl_VertexID >> 1, side = gl_VertexID & 1;
      ivec2 node = ivec2(along, gl_InstanceID + side);
      bool isLow = part == 2;
      vec3 normal = vec3(0, 0, -1);
      if (part == 1) {
        isLow = side == 1;
        bool isAlongX = gl_InstanceID < 2; int far = gl_InstanceID & 1;
        node = isAlongX ? ivec2(along, far * (count.y - 1)) : ivec2(far * (count.x - 1), along);
        normal = isAlongX ? vec3(0, 1, 0) : vec3(1, 0, 0);
      }
      if (part == 2) node = ivec2(along * (count.x - 1), side * (count.y - 1));
      node = clamp(node, ivec2(0), count - 1);
      float height = heightAt(node);
      if (part == 0)
        normal = normalize(vec3(heightAt(node - ivec2(1, 0)) - heightAt(node + ivec2(1, 0)),
                                heightAt(node - ivec2(0, 1)) - heightAt(node + ivec2(0, 1)), 2.0 * pitch));
      vec2 design = texelFetch(designTop, node, 0).rg;
      leftUm = (height - design.r) * normal.z * 1000.0;
      isJudged = part == 0 && normal.z > 0.35 ? design.g : 0.0;    // on walls a vertical distance says nothing
      isCut = part == 0 && height < top - 0.001 ? 1.0 : 0.0;
      seenNormal = eye * mat3(place) * normal;
      at = vec2(node);
      standsMm = part == 0 ? height - bottom : part == 1 ? 1.0 : -1.0;
      gl_Position = clip * place * vec4(origin + at * pitch, isLow ? bottom : height, 1.0);
    }`, SHADER_COLOURS + `
    in vec3 seenNormal; in float leftUm, isCut, isJudged, standsMm; in vec2 at;
    uniform sampler2D heights; uniform float scaleUm, bottom; uniform bool byDeviation;
    out vec4 pixel;
    void main() {
      float stands = standsMm < 0.0 ? texelFetch(heights, ivec2(at + 0.5), 0).r - bottom : standsMm;    // of the bottom: above it
      if (stands < 1e-3) discard;
      vec3 base = mix(vec3(0.74, 0.67, 0.56), vec3(0.76, 0.79, 0.84), isCut);
      if (byDeviation) base = isJudged < 0.999 ? vec3(0.62) : deviationColour(leftUm / scaleUm);
      pixel = vec4(lit(normalize(seenNormal), base), 1.0);
    }`],

  // Path: hairlines; a segment has the colour of the point it ends at (the last vertex provokes).
  path: [`
    in vec3 position; in vec4 colour; in float seconds;
    uniform mat4 clip; uniform float now, futureOpacity, lift;
    flat out vec4 lineColour;
    void main() {
      lineColour = colour;
      if (seconds > now) lineColour.a *= futureOpacity;
      gl_Position = clip * vec4(position, 1.0);
      gl_Position.z -= 0.0004 * lift;
    }`, `
    flat in vec4 lineColour; out vec4 pixel;
    void main() { if (lineColour.a <= 0.0) discard; pixel = lineColour; }`],

  // Wide lines: each an instanced quad of a given width in pixels.
  line: [`
    in vec3 start; in vec3 end;
    uniform mat4 clip; uniform vec2 halfViewport; uniform float widthPixels, lift;
    void main() {
      vec4 a = clip * vec4(start, 1.0), b = clip * vec4(end, 1.0);
      vec2 along = (b.xy - a.xy) * halfViewport;
      along = length(along) > 1e-6 ? normalize(along) : vec2(1, 0);
      bool isStart = (gl_VertexID & 1) == 0;
      vec2 across = vec2(-along.y, along.x) * ((gl_VertexID & 2) == 0 ? -0.5 : 0.5);
      gl_Position = isStart ? a : b;
      gl_Position.xy += (across + along * (isStart ? -0.5 : 0.5)) * widthPixels / halfViewport;
      gl_Position.z -= 0.0006 * lift;
    }`, `
    uniform vec4 colour; out vec4 pixel;
    void main() { pixel = colour; }`],
};

function compileProgram([vertexText, fragmentText]) {
  const handle = gl.createProgram();
  for (const [type, text] of [[gl.VERTEX_SHADER, vertexText], [gl.FRAGMENT_SHADER, fragmentText]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, SHADER_HEAD + text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(handle, shader);
  }
  gl.linkProgram(handle);
  if (!gl.getProgramParameter(handle, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(handle));
  const uniforms = {};
  for (let i = 0; i < gl.getProgramParameter(handle, gl.ACTIVE_UNIFORMS); i++) {
    const name = gl.getActiveUniform(handle, i).name;
    uniforms[name] = gl.getUniformLocation(handle, name);
  }
  return { handle, uniforms };
}

// ---------------------------------------------------------------- buffers

function makeBuffer(data, target = gl.ARRAY_BUFFER, usage = gl.STATIC_DRAW) {
  const buffer = gl.createBuffer();
  gl.bindBuffer(target, buffer);
  gl.bufferData(target, data, usage);
  return buffer;
}

// Binds a buffer to a named input of a program; `divisor` 1 means once per instance.
function bindInput(program, name, buffer, size, { type = gl.FLOAT, normalized = false, stride = 0, offset = 0, divisor = 0 } = {}) {
  const location = gl.getAttribLocation(program.handle, name);
  if (location < 0) return;
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.enableVertexAttribArray(location);
  gl.vertexAttribPointer(location, size, type, normalized, stride, offset);
  gl.vertexAttribDivisor(location, divisor);
}

function makeLayout(bind) {
  const layout = gl.createVertexArray();
  gl.bindVertexArray(layout);
  bind();
  gl.bindVertexArray(null);
  return layout;
}

// Wide lines from pairs of points (six numbers a line).
function makeLines(pairs) {
  const buffer = makeBuffer(new Float32Array(pairs));
  const layout = makeLayout(() => {
    bindInput(programs.line, "start", buffer, 3, { stride: 24, divisor: 1 });
    bindInput(programs.line, "end", buffer, 3, { stride: 24, offset: 12, divisor: 1 });
  });
  return { layout, count: pairs.length / 6 };
}

function makeTexture(format, components, width, height, data) {
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
  gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, height, components, gl.FLOAT, data);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
  return texture;
}

// ---------------------------------------------------------------- the design

async function loadDesign() {
  const reader = await unpackBlock("mesh");
  return { ...makeMesh(reader, scene.mesh), edges: makeLines(edgePairs(reader, scene.mesh)) };
}

// Shaded triangles, each vertex with its deviation.
function makeMesh(reader, meta) {
  const positions = takePoints(reader, meta.vertices, meta.low, meta.size);
  const normals = takeNormals(reader, meta.vertices);
  const steps = reader.take(Int16Array, meta.vertices);
  const triangles = Uint32Array.from(reader.takeDelta(Int32Array, 3 * meta.triangles));
  // validity travels beside the value: a "not judged" number would be interpolated into false bands
  const deviation = new Float32Array(2 * meta.vertices);
  steps.forEach((step, i) => {
    const isJudged = step !== meta.notJudged;
    deviation[2 * i] = isJudged ? step * meta.deviationStepUm : 0;
    deviation[2 * i + 1] = isJudged ? 1 : 0;
  });
  const layout = makeLayout(() => {
    bindInput(programs.surface, "position", makeBuffer(positions), 3);
    bindInput(programs.surface, "normal", makeBuffer(normals), 3);
    const buffer = makeBuffer(deviation);
    bindInput(programs.surface, "deviation", buffer, 1, { stride: 8 });
    bindInput(programs.surface, "judged", buffer, 1, { stride: 8, offset: 4 });
    makeBuffer(triangles, gl.ELEMENT_ARRAY_BUFFER);
  });
  return { layout, count: triangles.length };
}

// Polylines -> pairs of neighbouring points.
function edgePairs(reader, meta) {
  const points = takePoints(reader, meta.edgePoints, meta.low, meta.size);
  const lengths = reader.take(Int32Array, meta.edges), pairs = [];
  let first = 0;
  for (const length of lengths) {
    for (let i = first; i < first + length - 1; i++) pairs.push(...points.subarray(3 * i, 3 * i + 6));
    first += length;
  }
  return pairs;
}

// ---------------------------------------------------------------- one setup: path, stock, cutters

// Setups that one program cuts are shown as one: its time runs through all of them.
async function loadProgram(number) {
  const k = machine ? machine.motions.findIndex(meta => meta.setups.includes(number)) : -1;
  const numbers = k < 0 ? [number] : machine.motions[k].setups;
  const motion = k < 0 ? null : new MachineChain.Motion(await unpackBlock("motion-" + k), machine.motions[k], machine.letters);
  const setups = await Promise.all(numbers.map(loadSetup));
  setups.forEach((setup, i) => READY.set(numbers[i], { ...setup, number: numbers[i], motion }));
}

function loaded(number) {
  if (!LOADED.has(number)) {
    const program = machine && machine.motions.find(meta => meta.setups.includes(number));
    const promise = loadProgram(number);
    (program ? program.setups : [number]).forEach(n => LOADED.set(n, promise));
  }
  return LOADED.get(number);
}

async function loadSetup(number) {
  const meta = scene.setups[number];
  const [pathReader, replayReader, standing] = await Promise.all(
    ["path-", "replay-", "standing-"].map(name => unpackBlock(name + number)));
  return {
    meta, place: placement(meta.rotation, [0, 0, 0]),
    path: makePath(pathReader, meta.path),
    replay: new StockReplay(replayReader, meta.replay),
    tools: meta.operations.map(operation => operation.silhouette.map(makeToolPart)),
    stockEdges: makeLines(standing.take(Float32Array, 6 * meta.stockEdges)),
    fixtureEdges: makeLines(standing.take(Float32Array, 6 * meta.fixtureEdges)), triad: makeTriad(meta),
  };
}

function makePath(reader, meta) {
  const positions = new Float32Array(3 * meta.points);
  for (let k = 0; k < 3; k++) {
    const column = reader.takeDelta(Int32Array, meta.points);
    for (let i = 0; i < meta.points; i++) positions[3 * i + k] = column[i] * meta.stepMm;
  }
  const feed = Float32Array.from(reader.takeDelta(Int32Array, meta.points), steps => steps * meta.feedStep);
  const seconds = Float64Array.from(reader.takeDelta(Int32Array, meta.points), ms => ms / 1000);
  const operation = reader.take(Int16Array, meta.points), isRapid = reader.take(Uint8Array, meta.points);
  const line = reader.takeDelta(Int32Array, meta.points);
  const met = new Map(meta.met.map(column => [column.name, reader.take(Uint8Array, meta.points)]));
  const colours = makeBuffer(new Uint8Array(4 * meta.points), gl.ARRAY_BUFFER, gl.DYNAMIC_DRAW);
  const layout = makeLayout(() => {
    bindInput(programs.path, "position", makeBuffer(positions), 3);
    bindInput(programs.path, "colour", colours, 4, { type: gl.UNSIGNED_BYTE, normalized: true });
    bindInput(programs.path, "seconds", makeBuffer(new Float32Array(seconds)), 1);
  });
  const duration = meta.points ? seconds[meta.points - 1] : 0;
  return { count: meta.points, positions, feed, seconds, operation, isRapid, line, met, colours, layout, duration };
}

// The verifier's z-map. Every event keeps the height before it, so that time runs both ways and
// a seek costs only the events between the two instants.
class StockReplay {
  constructor(reader, meta) {
    this.meta = meta;
    this.instant = reader.takeDelta(Uint16Array, meta.events);
    this.cell = reader.takeDelta(Int32Array, meta.events);
    const toHeight = (meta.topMm - meta.bottomMm) / 65535;
    this.after = Float32Array.from(reader.take(Uint16Array, meta.events), z => meta.bottomMm + z * toHeight);
    const cells = meta.nx * meta.ny;
    const designTop = reader.takeDelta(Uint16Array, cells), isDesign = reader.take(Uint8Array, cells);
    this.heights = new Float32Array(cells).fill(meta.topMm);
    this.before = new Float32Array(meta.events);
    this.next = 0;                                  // the first event not yet applied
    this.goTo(meta.instants, (event, cell) => { this.before[event] = this.heights[cell]; });
    const design = new Float32Array(2 * cells);
    for (let i = 0; i < cells; i++) { design[2 * i] = meta.bottomMm + designTop[i] * toHeight; design[2 * i + 1] = isDesign[i]; }
    this.heightTexture = makeTexture(gl.R32F, gl.RED, meta.nx, meta.ny, this.heights);
    this.designTexture = makeTexture(gl.RG32F, gl.RG, meta.nx, meta.ny, design);
  }

  // Applies or takes back events until exactly those up to `instant` are done; says if any was.
  goTo(instant, visit = () => {}) {
    const started = this.next;
    while (this.next < this.cell.length && this.instant[this.next] <= instant) {
      visit(this.next, this.cell[this.next]);
      this.heights[this.cell[this.next]] = this.after[this.next];
      this.next++;
    }
    while (this.next > 0 && this.instant[this.next - 1] > instant) {
      this.next--;
      this.heights[this.cell[this.next]] = this.before[this.next];
    }
    return this.next !== started;
  }

  upload() {
    gl.bindTexture(gl.TEXTURE_2D, this.heightTexture);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, this.meta.nx, this.meta.ny, gl.RED, gl.FLOAT, this.heights);
  }
}

const TOOL_SECTORS = 40, BODY_SECTORS = 96;
const PART_COLOURS = { flutes: [0.98, 0.80, 0.30], shank: [0.72, 0.73, 0.76], holder: [0.36, 0.39, 0.45] };

// A part of a tool: an outline [[radius, height], ...] turned about the axis, shaded facet by facet along the height; on
// a head that axis lies along X, `toward` its plus or minus, and the head itself is a box.
function makeToolPart(part) {
  return { ...makeTurned(part, TOOL_SECTORS), colour: PART_COLOURS[part.part] };
}

function makeTurned({ outline, toward, box }, sectors) {
  const positions = [], normals = [];
  const laid = ([x, y, z]) => toward ? [toward * z, y, -toward * x] : [x, y, z];
  const corner = ([radius, height], sector) => {
    const angle = sector / sectors * 2 * Math.PI;
    return [radius * Math.cos(angle), radius * Math.sin(angle), height];
  };
  if (box) pushBox(box, positions, normals);
  outline = outline || [];
  for (let i = 0; i + 1 < outline.length; i++) {
    const [lower, upper] = [outline[i], outline[i + 1]];
    const rise = upper[1] - lower[1], widening = upper[0] - lower[0], length = Math.hypot(rise, widening) || 1;
    const normalAt = sector => [...corner([rise / length, 0], sector).slice(0, 2), -widening / length];
    for (let k = 0; k < sectors; k++) {
      for (const [end, sector] of [[lower, k], [lower, k + 1], [upper, k + 1], [lower, k], [upper, k + 1], [upper, k]]) {
        positions.push(...laid(corner(end, sector)));
        normals.push(...laid(normalAt(sector)));
      }
    }
  }
  const layout = makeLayout(() => {
    bindInput(programs.surface, "position", makeBuffer(new Float32Array(positions)), 3);
    bindInput(programs.surface, "normal", makeBuffer(new Float32Array(normals)), 3);
  });
  return { layout, count: positions.length / 3 };
}

// The six sides of a box, two triangles each.
function pushBox([low, high], positions, normals) {
  for (let axis = 0; axis < 3; axis++)
    for (const side of [0, 1])
      for (const [a, b] of [[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]]) {
        const bits = [0, 0, 0], normal = [0, 0, 0];
        bits[axis] = side; bits[(axis + 1) % 3] = a; bits[(axis + 2) % 3] = b;
        normal[axis] = 2 * side - 1;
        positions.push(...bits.map((bit, k) => (bit ? high : low)[k]));
        normals.push(...normal);
      }
}

const AXES = [["X", [0.85, 0.15, 0.12, 1]], ["Y", [0.10, 0.60, 0.20, 1]], ["Z", [0.15, 0.35, 0.90, 1]]];

// The WCS: an arrow an axis, with the letter's place.
function makeTriad(setup) {
  const diagonal = Math.hypot(...subtract(scene.box[1], scene.box[0])), length = 0.14 * diagonal;
  return AXES.map(([letter, colour], k) => {
    const axis = [0, 0, 0], side = [0, 0, 0];
    axis[k] = length; side[(k + 1) % 3] = 0.05 * length;
    const barb = s => addScaled(addScaled([0, 0, 0], axis, 0.86), side, s);
    const points = [[[0, 0, 0], axis], [axis, barb(1)], [axis, barb(-1)]].flat().map(p => fromWcs(setup, p));
    return { letter, colour, lines: makeLines(points.flat()), tip: fromWcs(setup, axis.map(v => v * 1.08)) };
  });
}

// ---------------------------------------------------------------- the machine

const { times, inverse, apply, rigid, shift, UNMOVED } = MachineChain;

// Machine coordinates with what is up on the machine turned up on the screen.
const UPWARD = { X: rigid([0, 0, -1, 0, 1, 0, 1, 0, 0], [0, 0, 0]), Y: rigid([1, 0, 0, 0, 0, -1, 0, 1, 0], [0, 0, 0]), Z: UNMOVED };

async function loadMachine() {
  const bodies = await Promise.all(machine.bodies.map(async (body, k) => {
    const solid = body.mesh ? makeMesh(await unpackBlock("body-" + k), body.mesh) : makeTurned(body, BODY_SECTORS);
    return { ...body, ...solid, colour: hexColour(body.colour).map(v => v / 255), isIndexed: Boolean(body.mesh),
             place: body.foot ? rigid(body.turn, body.foot) : UNMOVED, corners: cornersOf(body) };
  }));
  const tools = new Map(Object.entries(machine.tools).map(([number, tool]) => [Number(number), {
    parts: tool.silhouette.map(makeToolPart), place: times(shift(tool.tip), rigid(machine.toolTurn, [0, 0, 0])),
    length: Math.hypot(...tool.tip) }]));
  return { bodies, tools };
}

// The eight corners of the box round a body, before it is placed.
function cornersOf({ box, mesh, outline }) {
  let [low, high] = box || [[0, 0, 0], [0, 0, 0]];
  if (mesh) [low, high] = [mesh.low, mesh.low.map((v, k) => v + mesh.size[k])];
  if (outline) {
    const radius = Math.max(...outline.map(p => p[0])), heights = outline.map(p => p[1]);
    [low, high] = [[-radius, -radius, Math.min(...heights)], [radius, radius, Math.max(...heights)]];
  }
  return [...Array(8).keys()].map(n => [0, 1, 2].map(k => (n >> k & 1 ? high : low)[k]));
}

// Where everything stands in the world at the shown time: the part's coordinates, the nose, the links of the machine.
function framesNow() {
  if (!current.motion) return { design: UNMOVED };
  const at = momentNow(), seen = MachineChain.stand(machine, at.joints), part = times(seen.part, current.motion.place);
  const world = state.stands === "machine" ? UPWARD[machine.upward] : inverse(part);
  const links = Object.fromEntries(Object.entries(seen.links).map(([link, m]) => [link, times(world, m)]));
  return { at, links, nose: times(world, seen.nose), design: state.stands === "machine" ? times(world, part) : UNMOVED };
}

// How far the part has gone from where the design has it: what looks at the work goes along.
function anchorOf(frames) {
  if (state.stands === "part" || state.region === "machine") return [0, 0, 0];
  const center = mix(scene.box[0], scene.box[1], 0.5);
  return subtract(apply(frames.design, center), center);
}

const hasBodies = () => Boolean(current.motion && state.bodies && machineParts.bodies.length);

// Corners of part and, where it is shown, machine, in the world.
function cornersNow(frames, withMachine) {
  const part = cornersOf({ box: scene.box }).map(p => apply(frames.design, p));
  if (!withMachine || !current.motion) return part;
  const bodies = machineParts.bodies.flatMap(body => {
    const place = times(frames.links[body.link], body.place);
    return body.corners.map(p => apply(place, p));
  });
  return [...part, ...bodies, apply(frames.nose, [0, 0, 0])];
}

function boxOf(points) {
  return [Math.min, Math.max].map(pick => [0, 1, 2].map(k => pick(...points.map(p => p[k]))));
}

// What the views fit into the window: part and stock; with the machine standing the tool above them too; or all of it.
function fitBox() {
  const frames = framesNow(), center = mix(scene.box[0], scene.box[1], 0.5);
  if (hasBodies() && state.region === "machine") return boxOf(cornersNow(frames, true));
  if (state.stands === "part") return scene.box;
  const diagonal = Math.hypot(...subtract(scene.box[1], scene.box[0]));
  const tool = machineParts.tools.get(frames.at.tool), half = 0.5 * diagonal + 0.4 * (tool ? tool.length : 0);
  return [center.map(v => v - half), center.map(v => v + half)];
}

function setStands(name) {
  state.stands = name;
  setBodies(name === "machine" || state.bodies);
  document.querySelectorAll("input[name=stands]").forEach(radio => { radio.checked = radio.value === name; });
  showView("iso");
}

function setBodies(areShown) {
  state.bodies = areShown;
  byId("bodies").checked = areShown;
  isDirty = true;
}

function setRegion(name) {
  state.region = name;
  byId("region").value = name;
  if (name === "machine") setBodies(true);
}

// ---------------------------------------------------------------- colours of the path

const hexColour = text => [1, 3, 5].map(i => parseInt(text.slice(i, i + 2), 16));
const RAPID_COLOUR = [214, 48, 49, 170];
const NO_OPERATION_COLOUR = [128, 128, 128];

// Little blue, middling green, much orange; the legend's CSS gradient has the same stops.
const PATH_STOPS = [[46, 89, 217], [18, 160, 92], [240, 140, 20]];
const MET_LEVELS = 254;           // of what the edges meet, from 1; 0: not looked at
function scaleColour(share) {
  const s = clamp(share, 0, 1) * 2, first = Math.min(1, Math.floor(s));
  return mix(PATH_STOPS[first], PATH_STOPS[first + 1], s - first);
}

// What the path is coloured by, as a function of the point.
function colourOfPoint() {
  const { path, meta } = current, met = path.met.get(state.pathColour);
  if (state.pathColour === "feed") return i => scaleColour(path.feed[i] / (meta.path.feedMax || 1));
  if (met) return i => met[i] ? scaleColour((met[i] - 1) / MET_LEVELS) : NO_OPERATION_COLOUR;
  const byOperation = meta.operations.map(operation => hexColour(operation.colour));
  return i => byOperation[path.operation[i]] || NO_OPERATION_COLOUR;
}

function colourPath() {
  const { path } = current, colours = new Uint8Array(4 * path.count), colourOf = colourOfPoint();
  for (let i = 0; i < path.count; i++) {
    if (path.isRapid[i]) colours.set(state.rapids ? RAPID_COLOUR : [0, 0, 0, 0], 4 * i);
    else colours.set([...colourOf(i), 255], 4 * i);
  }
  gl.bindBuffer(gl.ARRAY_BUFFER, path.colours);
  gl.bufferSubData(gl.ARRAY_BUFFER, 0, colours);
  isDirty = true;
}

// ---------------------------------------------------------------- camera (parallel projection)

const VIEWS = {
  iso: [-0.95, 0.62], top: [-Math.PI / 2, Math.PI / 2], front: [-Math.PI / 2, 0], right: [0, 0],
  back: [Math.PI / 2, 0], left: [Math.PI, 0], bottom: [-Math.PI / 2, -Math.PI / 2],
};

// Unit vectors of the screen: to the right, up, and towards the eye.
function eyeAxes() {
  const cy = Math.cos(state.yaw), sy = Math.sin(state.yaw), cp = Math.cos(state.pitch), sp = Math.sin(state.pitch);
  return { right: [-sy, cy, 0], up: [-cy * sp, -sy * sp, cp], back: [cy * cp, sy * cp, sp] };
}

function camera(frames) {
  const { right, up, back } = eyeAxes(), aspect = canvas.width / canvas.height;
  const alone = 2 * Math.hypot(...subtract(scene.box[1], scene.box[0])), target = addScaled(state.target, anchorOf(frames), 1);
  const [low, high] = current.motion ? boxOf(cornersNow(frames, hasBodies())) : scene.box;
  const reach = current.motion ? 2 * machineReach(frames) : 0;
  const depth = 2 * Math.hypot(...subtract(high, low)) + Math.hypot(...subtract(target, mix(low, high, 0.5))) + reach;
  const rows = [[right, 1 / (state.halfHeight * aspect)], [up, 1 / state.halfHeight], [back, -1 / depth]];
  const clip = new Float32Array(16);
  rows.forEach(([axis, scale], row) => {
    for (let k = 0; k < 3; k++) clip[4 * k + row] = axis[k] * scale;
    clip[12 + row] = -dot(axis, target) * scale;
  });
  clip[15] = 1;
  const eye = new Float32Array([0, 1, 2].flatMap(k => [right[k], up[k], back[k]]));
  return { clip, eye, onPart: times(clip, frames.design), lift: alone / depth, frames };
}

// How far the tool reaches from the nose; a tool on its own is drawn whole.
function machineReach(frames) {
  const tool = machineParts.tools.get(frames.at.tool);
  return tool ? tool.length : 0;
}

// Turns to a named view and fits part and stock into the window.
function showView(name) {
  [state.yaw, state.pitch] = VIEWS[name];
  const box = fitBox(), { right, up } = eyeAxes(), half = subtract(box[1], box[0]).map(v => v / 2);
  const reach = axis => half.reduce((sum, h, k) => sum + Math.abs(h * axis[k]), 0);
  const width = canvas.clientWidth || 1, height = canvas.clientHeight || 1;
  const bar = byId("time").offsetHeight + 10, free = Math.max(0.4 * height, height - bar);
  state.halfHeight = 1.15 * Math.max(reach(up) * height / free, reach(right) * height / width);
  // the time bar covers the lower edge: the part moves up by half of it
  state.target = addScaled(mix(box[0], box[1], 0.5), up, -state.halfHeight * Math.min(bar, height - free) / height);
  isDirty = true;
}

// ---------------------------------------------------------------- time

const duration = () => (current.motion || current.path).duration;

// What the machine does at the shown time; without one, how long the setup's own path has run.
function momentNow() {
  const seconds = state.fraction * duration();
  return current.motion ? current.motion.at(seconds) : { setup: current.number, ownSeconds: seconds };
}

// Number of the last point reached at a time.
function pointBefore(seconds) {
  const times = current.path.seconds;
  let low = 0, high = current.path.count - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= seconds) low = middle; else high = middle;
  }
  return low;
}

// Where the cutter stands at the shown time, and what it is doing.
function cutterNow() {
  const path = current.path, moment = momentNow(), seconds = moment.ownSeconds;
  if (!path.count) return { tip: [0, 0, 0], operation: -1, feed: 0, isRapid: false, line: 0 };
  const before = pointBefore(seconds), after = Math.min(before + 1, path.count - 1);
  const span = path.seconds[after] - path.seconds[before];
  const share = span > 0 ? clamp((seconds - path.seconds[before]) / span, 0, 1) : 1;
  const point = i => [path.positions[3 * i], path.positions[3 * i + 1], path.positions[3 * i + 2]];
  return { tip: tipOfJoints(moment) || mix(point(before), point(after), share), operation: path.operation[after],
           feed: path.feed[after], isRapid: Boolean(path.isRapid[after]), line: path.line[after], ...moment };
}

// Tip in the part by the joints: while the machine turns to another position no path says it.  null: no tool, or no machine.
function tipOfJoints({ joints, tool }) {
  const held = joints && machineParts.tools.get(tool);
  if (!held) return null;
  const seen = MachineChain.stand(machine, joints), part = times(seen.part, current.motion.place);
  return apply(times(inverse(part), seen.nose), machine.tools[tool].tip);
}

// Shows a moment of the program, 0 its start, 1 its end.
function seek(fraction) {
  state.fraction = clamp(fraction, 0, 1);
  const moment = momentNow();
  if (moment.setup !== current.number) showSetup(moment.setup);
  const { replay, path } = current, share = path.duration > 0 ? moment.ownSeconds / path.duration : 1;
  if (replay.goTo(Math.floor((share > 1 - 1e-6 ? 1 : share) * replay.meta.instants))) replay.upload();
  showReadout();
  isDirty = true;
}

// ---------------------------------------------------------------- drawing

function useProgram(program, view, clip = view.clip) {
  gl.useProgram(program.handle);
  gl.uniformMatrix4fv(program.uniforms.clip, false, clip);
  if (program.uniforms.lift) gl.uniform1f(program.uniforms.lift, view.lift);
  if (program.uniforms.eye) gl.uniformMatrix3fv(program.uniforms.eye, false, view.eye);
  return program.uniforms;
}

function drawDesign(view) {
  const uniforms = useProgram(programs.surface, view);
  gl.uniformMatrix4fv(uniforms.place, false, view.frames.design);
  gl.uniform1f(uniforms.opacity, 1);
  gl.uniform3f(uniforms.colour, 0.70, 0.75, 0.82);
  gl.uniform1f(uniforms.scaleUm, state.scaleUm);
  gl.uniform1i(uniforms.byDeviation, state.surface === "deviation");
  gl.bindVertexArray(design.layout);
  gl.drawElements(gl.TRIANGLES, design.count, gl.UNSIGNED_INT, 0);
}

function drawStock(view) {
  const uniforms = useProgram(programs.stock, view), { replay, place } = current, meta = replay.meta;
  gl.activeTexture(gl.TEXTURE1);
  gl.bindTexture(gl.TEXTURE_2D, replay.designTexture);
  gl.activeTexture(gl.TEXTURE0);
  gl.bindTexture(gl.TEXTURE_2D, replay.heightTexture);
  gl.uniform1i(uniforms.heights, 0);
  gl.uniform1i(uniforms.designTop, 1);
  gl.uniformMatrix4fv(uniforms.place, false, times(view.frames.design, place));
  gl.uniform2i(uniforms.count, meta.nx, meta.ny);
  gl.uniform2f(uniforms.origin, ...meta.originMm);
  gl.uniform1f(uniforms.pitch, meta.pitchMm);
  gl.uniform1f(uniforms.bottom, meta.bottomMm);
  gl.uniform1f(uniforms.top, meta.topMm);
  gl.uniform1f(uniforms.scaleUm, state.scaleUm);
  gl.uniform1i(uniforms.byDeviation, state.surface === "rest");
  gl.bindVertexArray(null);
  const parts = [[2 * meta.nx, meta.ny - 1], [2 * Math.max(meta.nx, meta.ny), 4], [4, 1]];
  parts.forEach(([vertices, strips], part) => {
    gl.uniform1i(uniforms.part, part);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, vertices, strips);
  });
}

function drawCutter(view) {
  const { frames } = view, isMoving = Boolean(current.motion);
  if (state.fraction >= 1 && state.stands === "part") return;
  const now = cutterNow(), tool = isMoving ? machineParts.tools.get(frames.at.tool) : null;
  const parts = isMoving ? tool && tool.parts : current.tools[now.operation];
  if (parts) drawParts(view, parts, isMoving ? times(frames.nose, tool.place) : placement(current.meta.rotation, now.tip));
}

function drawBodies(view) {
  gl.depthMask(!state.seeThrough);
  for (const body of machineParts.bodies)
    drawParts(view, [body], times(view.frames.links[body.link], body.place), state.seeThrough ? SEEN_THROUGH : 1);
  gl.depthMask(true);
}

const SEEN_THROUGH = 0.28;        // of a body's colour stays

// Shaded solids, each in its colour.
function drawParts(view, parts, place, opacity = 1) {
  const uniforms = useProgram(programs.surface, view);
  gl.uniform1f(uniforms.opacity, opacity);
  gl.uniformMatrix4fv(uniforms.place, false, place);
  gl.uniform1i(uniforms.byDeviation, 0);
  for (const part of parts) {
    gl.uniform3f(uniforms.colour, ...part.colour);
    gl.bindVertexArray(part.layout);
    if (part.isIndexed) gl.drawElements(gl.TRIANGLES, part.count, gl.UNSIGNED_INT, 0);
    else gl.drawArrays(gl.TRIANGLES, 0, part.count);
  }
}

function drawPath(view) {
  const uniforms = useProgram(programs.path, view, view.onPart), { path } = current;
  gl.uniform1f(uniforms.now, state.paths === "all" && state.fraction >= 1 ? Infinity : momentNow().ownSeconds);
  gl.uniform1f(uniforms.futureOpacity, state.paths === "all" ? 0.15 : 0);
  gl.bindVertexArray(path.layout);
  gl.drawArrays(gl.LINE_STRIP, 0, path.count);
}

function drawLines(view, lines, colour, width) {
  const uniforms = useProgram(programs.line, view, view.onPart);
  gl.uniform2f(uniforms.halfViewport, canvas.width / 2, canvas.height / 2);
  gl.uniform1f(uniforms.widthPixels, width * pixelRatio());
  gl.uniform4f(uniforms.colour, ...colour);
  gl.bindVertexArray(lines.layout);
  gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, lines.count);
}

const pixelRatio = () => Math.min(2, window.devicePixelRatio || 1);

// The canvas follows its place on the page; false while it has none.
function fitCanvas() {
  const width = Math.round(canvas.clientWidth * pixelRatio()), height = Math.round(canvas.clientHeight * pixelRatio());
  if (!width || !height) return false;
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; isDirty = true; }
  return true;
}

function backgroundColour() {
  const text = getComputedStyle(byId("view")).getPropertyValue("--view-background").trim();
  return hexColour(text).map(v => v / 255);
}

function draw() {
  isDirty = false;
  const view = camera(framesNow());
  gl.viewport(0, 0, canvas.width, canvas.height);
  gl.clearColor(...backgroundColour(), 1);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.enable(gl.DEPTH_TEST);

  gl.enable(gl.POLYGON_OFFSET_FILL);          // solids step back so that lines on them stay whole
  gl.polygonOffset(1, 1);
  if (state.surface === "stock" || state.surface === "rest") drawStock(view); else drawDesign(view);
  if (state.cutter) drawCutter(view);
  if (hasBodies() && !state.seeThrough) drawBodies(view);
  gl.disable(gl.POLYGON_OFFSET_FILL);

  gl.enable(gl.BLEND);
  gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  if (state.edges) drawLines(view, design.edges, [0.06, 0.08, 0.12, 1], 1.1);
  if (state.stockEdges) drawLines(view, current.stockEdges, [0.75, 0.45, 0.10, 0.9], 1);
  if (state.fixtures) drawLines(view, current.fixtureEdges, [0.20, 0.40, 0.62, 0.9], 1);
  if (state.paths !== "none") drawPath(view);
  for (const axis of current.triad) drawLines(view, axis.lines, axis.colour, 2.2);
  if (hasBodies() && state.seeThrough) drawBodies(view);
  gl.disable(gl.BLEND);
  gl.bindVertexArray(null);
  placePins(view.onPart);
}

// ---------------------------------------------------------------- pins: HTML over the picture

const pinElements = [];

function makePins() {
  const layer = byId("pins");
  for (const pin of scene.pins) {
    const element = addPin(layer, pin.label, pin.kind, pin.title);
    element.onclick = () => goToFinding(pin);
    pinElements.push({ element, place: () => pin.place, isPin: true });
  }
  AXES.forEach(([letter], k) => pinElements.push({ element: addPin(layer, letter, "axis", ""), place: () => current.triad[k].tip, isPin: false }));
}

function addPin(layer, text, kind, title) {
  const element = document.createElement("span");
  element.className = "pin " + kind;
  element.textContent = text;
  element.title = title;
  layer.append(element);
  return element;
}

function placePins(clip) {
  for (const { element, place, isPin } of pinElements) {
    const p = place();
    const at = row => clip[row] * p[0] + clip[4 + row] * p[1] + clip[8 + row] * p[2] + clip[12 + row];
    const x = at(0), y = at(1);
    element.hidden = Math.abs(x) > 1 || Math.abs(y) > 1 || (isPin && !state.pins);
    element.style.left = (x + 1) * 50 + "%";
    element.style.top = (1 - y) * 50 + "%";
  }
}

// ---------------------------------------------------------------- what is written beside the picture

function clockText(seconds) {
  const whole = Math.floor(seconds), pad = v => String(v).padStart(2, "0");
  return `${Math.floor(whole / 3600)}:${pad(Math.floor(whole / 60) % 60)}:${pad(whole % 60)}`;
}

function showReadout() {
  const now = cutterNow(), { meta } = current, operation = meta.operations[now.operation];
  const [x, y, z] = toWcs(meta, now.tip).map(v => v.toFixed(3).padStart(9));
  byId("read-time").textContent = `${clockText(state.fraction * duration())} / ${clockText(duration())}`;
  byId("read-tip").textContent = `${meta.wcs}  X${x}  Y${y}  Z${z}`;
  byId("read-joints").textContent = now.joints ? `machine  ${jointsText(now.joints)}` : "";
  byId("read-feed").textContent = now.isRapid ? "rapid" : `F ${now.feed.toFixed(0)}`;
  byId("read-line").textContent = now.line ? `line ${now.line}` : "";
  const position = current.motion && current.motion.meta.setups.length > 1 ? `${meta.name}: ` : "";
  byId("read-operation").textContent = operation ? `${position}${operation.name}  ${operation.tool}` : position && `to ${meta.name}`;
  byId("seek").value = state.fraction;
  markChapter(now.operation);
}

// Joints as the control shows them in machine coordinates, by their letters.
function jointsText(joints) {
  const rows = machine.letters.map((letter, k) => [letter, joints[k]]), isLength = letter => "XYZ".includes(letter);
  rows.sort((a, b) => isLength(b[0]) - isLength(a[0]) || (a[0] < b[0] ? -1 : 1));
  return rows.map(([letter, value]) => letter + (Math.abs(value) < 5e-4 ? 0 : value).toFixed(3).padStart(isLength(letter) ? 9 : 8, "\u00a0")).join("  ");
}

// Ticks on a scale from its quarter points, in micrometres.
function showScale() {
  const { path } = current.meta, met = path.met.find(column => column.name === state.pathColour);
  byId("scale-text").textContent = `±${state.scaleUm} µm`;
  byId("legend-low").textContent = `−${state.scaleUm} gouged`;
  byId("legend-high").textContent = `+${state.scaleUm} left`;
  byId("deviation-box").hidden = !(state.surface === "deviation" || state.surface === "rest");
  byId("path-box").hidden = state.paths === "none" || state.pathColour === "operation";
  byId("path-grey").hidden = !met;
  byId("path-high").textContent = met ? `${+met.most.toPrecision(3)} ${met.unit}` : `${path.feedMax.toFixed(0)} mm/min`;
  const { stride, pitchMm } = current.meta.replay;
  byId("stock-note").textContent = `Stock: the verifier's z-map, ${stride > 1 ? `every ${stride}. node, ` : ""}${+pitchMm.toFixed(3)} mm apart.`;
}

// One button an operation of the program, with its colour: its chapters.
function showChapters() {
  const list = byId("chapters"), marks = byId("marks"), { motion } = current;
  const numbers = motion ? motion.meta.setups : [current.number];
  list.replaceChildren();
  marks.replaceChildren();
  for (const number of numbers)
    for (const operation of scene.setups[number].operations) {
      const seconds = motion ? motion.whenOwn(number, operation.startSeconds) : operation.startSeconds;
      const start = duration() && seconds !== null ? seconds / duration() : 0;
      const button = document.createElement("button"), swatch = document.createElement("i");
      const name = document.createElement("b"), note = document.createElement("span");
      swatch.style.background = operation.colour;
      name.textContent = numbers.length > 1 ? `${scene.setups[number].name}: ${operation.name}` : operation.name;
      note.textContent = `${operation.tool}, ${operation.time}`;
      button.append(swatch, name, note);
      button.disabled = operation.startSeconds < 0;
      button.onclick = () => { watchStock(); seek(start); };
      list.append(button);
      const mark = document.createElement("i");
      mark.style.left = `${start * 100}%`;
      mark.style.background = operation.colour;
      if (!button.disabled) marks.append(mark);
    }
}

// The button of what is being done.
function markChapter(operation) {
  const numbers = current.motion ? current.motion.meta.setups : [current.number];
  const before = numbers.slice(0, numbers.indexOf(current.number)).reduce((n, k) => n + scene.setups[k].operations.length, 0);
  byId("chapters").querySelectorAll("button").forEach((button, k) => button.classList.toggle("current", operation >= 0 && k === before + operation));
}

// ---------------------------------------------------------------- controls

// Another setup: of the program that is shown its end, of another one the same share of its time.
async function chooseSetup(number) {
  await loaded(number);
  const isSameProgram = current && current.motion && current.motion === READY.get(number).motion;
  showSetup(number);
  seek(isSameProgram ? current.motion.endOf(number) / duration() : state.fraction);
}

function showSetup(number) {
  current = READY.get(number);
  state.setup = number;
  byId("setup").value = number;
  offerPathColours();
  colourPath();
  showChapters();
  showScale();
}

// By operation and feed, and by what the edges of this setup's cutters were seen to meet.
function offerPathColours() {
  const list = byId("path-colour"), { met } = current.meta.path;
  while (list.options.length > 2) list.remove(2);
  for (const column of met) list.add(new Option(`by ${column.label}`, column.name));
  if (![...list.options].some(option => option.value === state.pathColour)) state.pathColour = "operation";
  list.value = state.pathColour;
}

function setPlaying(isPlaying) {
  state.playing = isPlaying;
  const button = byId("play");
  button.textContent = isPlaying ? "❚❚" : "▶";
  button.setAttribute("aria-label", isPlaying ? "pause" : "play");
}

// Whoever moves time wants to see the stock change.
function watchStock() {
  if (state.surface === "design" || state.surface === "deviation") setSurface("stock");
}

function setSurface(name) {
  state.surface = name;
  document.querySelectorAll("input[name=surface]").forEach(radio => { radio.checked = radio.value === name; });
  showScale();
  isDirty = true;
}

function setPaths(name) {
  state.paths = name;
  byId("paths").value = name;
  showScale();
  isDirty = true;
}

function togglePlay() {
  watchStock();
  if (!state.playing && state.fraction >= 1) seek(0);
  setPlaying(!state.playing);
}

// The slider runs over a geometric row of scales: 1, 2, 5, 10 ... 1000 µm.
const SCALES_UM = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];

function firstScale() {
  const wanted = 1.5 * Math.max(scene.limitsUm.gouge, scene.limitsUm.scallop);
  const found = SCALES_UM.findIndex(scale => scale >= wanted);
  return found < 0 ? SCALES_UM.length - 1 : found;
}

function setScale(index) {
  state.scaleUm = SCALES_UM[index];
  byId("scale").value = index;
  showScale();
  isDirty = true;
}

function bindControls() {
  for (const [number, setup] of scene.setups.entries()) byId("setup").add(new Option(`${setup.name} (${setup.program})`, number));
  byId("setup-box").hidden = scene.setups.length < 2;
  byId("setup").onchange = event => chooseSetup(Number(event.target.value));
  document.querySelectorAll("input[name=surface]").forEach(radio => { radio.onchange = () => setSurface(radio.value); });
  byId("paths").onchange = event => setPaths(event.target.value);
  byId("path-colour").onchange = event => { state.pathColour = event.target.value; showScale(); colourPath(); };
  const boxes = { rapids: "rapids", edges: "edges", stockEdges: "stockEdges", fixtures: "fixtures", cutter: "cutter", pins: "pins-shown" };
  for (const [name, id] of Object.entries(boxes)) {
    byId(id).checked = state[name];
    byId(id).onchange = event => { state[name] = event.target.checked; if (name === "rapids") colourPath(); isDirty = true; };
  }
  byId("scale").max = SCALES_UM.length - 1;
  byId("scale").oninput = event => setScale(Number(event.target.value));
  byId("seek").oninput = event => { watchStock(); seek(Number(event.target.value)); };
  byId("play").onclick = togglePlay;
  byId("speed").onchange = event => { state.speed = Number(event.target.value); };
  document.querySelectorAll("[data-view]").forEach(button => { button.onclick = () => showView(button.dataset.view); });
  document.querySelectorAll("[data-finding]").forEach(button => { button.onclick = () => goToFinding(JSON.parse(button.dataset.finding)); });
  bindMachine();
  bindKeys();
  bindPointer();
  new ResizeObserver(() => { isDirty = true; }).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").onchange = () => { isDirty = true; };
}

function bindMachine() {
  byId("machine-box").hidden = !machine;
  if (!machine) return;
  document.querySelectorAll("input[name=stands]").forEach(radio => { radio.onchange = () => setStands(radio.value); });
  byId("bodies").onchange = event => setBodies(event.target.checked);
  byId("see-through").onchange = event => { state.seeThrough = event.target.checked; isDirty = true; };
  byId("region").onchange = event => { setRegion(event.target.value); showView("iso"); };
}

// Time of a line in the shown program, where several moves have it of the one nearest to a place; null: it moves nothing.
function secondsOfLine(line, place) {
  const { path, motion } = current, far = row => Math.hypot(...subtract(path.positions.subarray(3 * row, 3 * row + 3), place));
  let best = -1;
  for (let row = 0; row < path.count; row++)
    if (path.line[row] === line && (best < 0 || !place || far(row) < far(best))) best = row;
  if (best < 0) return motion ? motion.whenLine(line) : null;
  return motion ? motion.whenOwn(current.number, path.seconds[best]) : path.seconds[best];
}

const BEFORE_S = 4e-4;        // times are whole milliseconds: the block that ends there is still the one shown

// To the block of a finding, and its place into the middle.
async function goToFinding({ setup, line, file, place }) {
  const number = scene.setups.findIndex(s => s.name === setup);
  if (number >= 0) {
    await chooseSetup(number);
    const seconds = line ? secondsOfLine(line + (current.meta.linesBefore[file] || 0), place) : null;
    if (seconds !== null && duration()) seek((seconds - BEFORE_S) / duration());
  }
  if (place) lookAt(place);
  byId("view").scrollIntoView({ block: "nearest" });
}

// Brings a place of a finding into the middle, close.
function lookAt(place) {
  if (machine) setRegion("work");
  const frames = framesNow();
  state.target = subtract(apply(frames.design, place), anchorOf(frames));
  state.halfHeight = 0.12 * Math.hypot(...subtract(scene.box[1], scene.box[0]));
  isDirty = true;
}

const KEYS = {
  " ": togglePlay,
  ArrowRight: event => { watchStock(); seek(state.fraction + (event.shiftKey ? 0.02 : 0.001)); },
  ArrowLeft: event => { watchStock(); seek(state.fraction - (event.shiftKey ? 0.02 : 0.001)); },
  Home: () => { watchStock(); seek(0); },
  End: () => seek(1),
  1: () => showView("iso"), 2: () => showView("top"), 3: () => showView("front"), 4: () => showView("right"),
  5: () => showView("back"), 6: () => showView("left"), 7: () => showView("bottom"),
  s: () => setSurface("stock"), r: () => setSurface("rest"), d: () => setSurface("deviation"), b: () => setSurface("design"),
  m: () => { if (machine) setStands(state.stands === "part" ? "machine" : "part"); },
  p: () => setPaths({ none: "all", all: "done", done: "none" }[state.paths]),
};

// Keys work while something inside the view has the focus; inputs keep their own keys.
function bindKeys() {
  byId("view").addEventListener("keydown", event => {
    const isInput = event.target.matches("input, select"), isPressing = event.key === " " && event.target.matches("button");
    if (isInput || isPressing || event.ctrlKey || event.metaKey || event.altKey || !KEYS[event.key]) return;
    event.preventDefault();
    KEYS[event.key](event);
  });
}

// One pointer turns (with shift or another button: moves), two move and zoom, the wheel zooms.
function bindPointer() {
  const pointers = new Map();
  canvas.onpointerdown = event => { canvas.setPointerCapture(event.pointerId); pointers.set(event.pointerId, event); };
  canvas.onpointerup = canvas.onpointercancel = event => pointers.delete(event.pointerId);
  canvas.oncontextmenu = event => event.preventDefault();
  canvas.onpointermove = event => {
    const old = pointers.get(event.pointerId);
    if (!old) return;
    const dx = event.clientX - old.clientX, dy = event.clientY - old.clientY;
    if (pointers.size === 2) {
      const other = [...pointers.values()].find(p => p.pointerId !== event.pointerId);
      const apart = p => Math.hypot(p.clientX - other.clientX, p.clientY - other.clientY) || 1;
      zoom(apart(old) / apart(event));
      pan(dx / 2, dy / 2);
    } else if (event.shiftKey || old.buttons > 1) pan(dx, dy);
    else turn(dx, dy);
    pointers.set(event.pointerId, event);
  };
  canvas.addEventListener("wheel", event => { event.preventDefault(); zoom(Math.exp(event.deltaY * 0.0012)); }, { passive: false });
}

function turn(dx, dy) {
  state.yaw -= dx * 0.008;
  state.pitch = clamp(state.pitch + dy * 0.008, -Math.PI / 2, Math.PI / 2);
  isDirty = true;
}

function pan(dx, dy) {
  const { right, up } = eyeAxes(), mmPerPixel = 2 * state.halfHeight / canvas.clientHeight;
  state.target = addScaled(addScaled(state.target, right, -dx * mmPerPixel), up, dy * mmPerPixel);
  isDirty = true;
}

function zoom(factor) {
  state.halfHeight *= factor;
  isDirty = true;
}

// The sheet alone goes to the printer; Ctrl-P prints the whole report.
byId("print-sheet").onclick = () => {
  document.body.classList.add("printing-sheet");
  window.print();
  document.body.classList.remove("printing-sheet");
};

// ---------------------------------------------------------------- start

let lastFrame = 0;

function onFrame(timestamp) {
  const elapsed = Math.min(0.1, (timestamp - lastFrame) / 1000);
  lastFrame = timestamp;
  if (state.playing) {
    seek(state.fraction + elapsed * state.speed / (duration() || 1));
    if (state.fraction >= 1) setPlaying(false);
  }
  if (fitCanvas() && isDirty) draw();
  requestAnimationFrame(onFrame);
}

// For tests and for the browser's console.
window.__view = {
  state, showView,
  seek: fraction => { seek(fraction); fitCanvas(); draw(); },
  set: changes => { Object.assign(state, changes); setSurface(state.surface); setPaths(state.paths); colourPath(); fitCanvas(); draw(); },
  chooseSetup, setStands, setRegion, goToFinding, framesNow,
};

async function start() {
  gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
  if (!gl) throw new Error("this browser offers no WebGL2");
  programs = Object.fromEntries(Object.entries(SHADERS).map(([name, texts]) => [name, compileProgram(texts)]));
  document.body.classList.remove("no-view");
  design = await loadDesign();
  if (machine) machineParts = await loadMachine();
  makePins();
  bindControls();
  await chooseSetup(0);
  setScale(firstScale());
  fitCanvas();
  showView("iso");
  draw();
}

// Without WebGL2 the page keeps its still pictures and says why.
start().then(() => requestAnimationFrame(onFrame))
  .catch(error => {
    document.body.classList.add("no-view");
    byId("view-message").textContent = `No interactive view: ${error.message}. Still pictures instead.`;
  })
  .finally(() => { window.__ready = true; });

})();

// The machine's chain: where its links, the part and the spindle stand for given joints, and the joints over a program's time.
//
// No page, no WebGL.  Matrices are column-major 4x4; lengths mm, angles degrees as the control shows them.
"use strict";

const MachineChain = (() => {

const UNMOVED = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

function times(a, b) {
  const out = new Array(16);
  for (let column = 0; column < 4; column++)
    for (let row = 0; row < 4; row++) {
      let sum = 0;
      for (let k = 0; k < 4; k++) sum += a[4 * k + row] * b[4 * column + k];
      out[4 * column + row] = sum;
    }
  return out;
}

const shift = ([x, y, z]) => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1];

// A row-major rotation (nine numbers) and where its origin stands.
const rigid = (r, [x, y, z]) => [r[0], r[3], r[6], 0, r[1], r[4], r[7], 0, r[2], r[5], r[8], 0, x, y, z, 1];

// Back again: the turn transposed, the shift taken through it.
function inverse(m) {
  const back = row => -(m[4 * row] * m[12] + m[4 * row + 1] * m[13] + m[4 * row + 2] * m[14]);
  return [m[0], m[4], m[8], 0, m[1], m[5], m[9], 0, m[2], m[6], m[10], 0, back(0), back(1), back(2), 1];
}

const apply = (m, [x, y, z]) => [0, 1, 2].map(row => m[row] * x + m[4 + row] * y + m[8 + row] * z + m[12 + row]);

// Right-handed about a unit vector through a point.
function turn([x, y, z], pivot, degrees) {
  const angle = degrees * Math.PI / 180, c = Math.cos(angle), s = Math.sin(angle), d = 1 - c;
  const r = [c + x * x * d, x * y * d - z * s, x * z * d + y * s,
             y * x * d + z * s, c + y * y * d, y * z * d - x * s,
             z * x * d - y * s, z * y * d + x * s, c + z * z * d];
  const moved = [0, 1, 2].map(k => pivot[k] - r[3 * k] * pivot[0] - r[3 * k + 1] * pivot[1] - r[3 * k + 2] * pivot[2]);
  return rigid(r, moved);
}

// What one joint does to all that stands nearer to the tool, seen from what stands nearer to the part.
function step(machine, joint, value) {
  const direction = machine.direction[joint];
  return machine.isRotary[joint] ? turn(direction, machine.pivot[joint], value) : shift(direction.map(v => v * value));
}

// Seen from the bed: {part, nose, links: {letter or "bed": matrix}}; a body moves with its link from where it is at 0.
function stand(machine, joints) {
  const order = machine.order, bed = order.indexOf("bed"), links = { bed: UNMOVED };
  const own = letter => step(machine, machine.letters.indexOf(letter), joints[machine.letters.indexOf(letter)]);
  let nose = UNMOVED, part = UNMOVED;
  for (const letter of order.slice(bed + 1)) links[letter] = nose = times(nose, own(letter));
  for (const letter of order.slice(0, bed).reverse()) links[letter] = part = times(part, inverse(own(letter)));
  return { part, nose, links };
}

// A program's joints: poses over time, evenly between two of them.
class Motion {
  constructor(reader, meta, letters) {
    const n = meta.poses, column = scale => Float64Array.from(reader.takeDelta(Int32Array, n), v => v * scale);
    this.meta = meta;
    this.count = n;
    this.joints = letters.map(() => column(meta.step));
    this.seconds = column(0.001);
    this.ownSeconds = column(0.001);
    this.line = reader.takeDelta(Int32Array, n);
    this.feed = column(0.1);
    this.tool = reader.take(Int32Array, n);
    this.operation = reader.take(Int16Array, n);
    this.setup = reader.take(Int16Array, n);
    this.isRapid = reader.take(Uint8Array, n);
    this.duration = n ? this.seconds[n - 1] : 0;
    this.place = rigid(meta.rotation, meta.origin);
  }

  // What the machine does at a time: joints, and what the block that it is in says.
  at(seconds) {
    const times = this.seconds;
    let low = 0, high = this.count - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= seconds) low = middle; else high = middle;
    }
    const span = times[high] - times[low], share = span > 0 ? Math.min(1, Math.max(0, (seconds - times[low]) / span)) : 1;
    const between = column => column[low] + (column[high] - column[low]) * share;
    const ownBefore = this.setup[low] === this.setup[high] ? this.ownSeconds[low] : 0;
    return { joints: this.joints.map(between), ownSeconds: ownBefore + (this.ownSeconds[high] - ownBefore) * share,
             setup: this.setup[high], operation: this.operation[high], tool: this.tool[high], line: this.line[high],
             feed: this.feed[high], isRapid: Boolean(this.isRapid[high]) };
  }

  // When a setup's own path has run for so long; null where it is not in this program.
  whenOwn(setup, ownSeconds) {
    const row = this.rowWhere(k => this.setup[k] === setup && this.ownSeconds[k] >= ownSeconds);
    if (row < 0) return null;
    const before = row > 0 && this.setup[row - 1] === setup ? row - 1 : row;
    const span = this.ownSeconds[row] - this.ownSeconds[before];
    const share = span > 0 ? (ownSeconds - this.ownSeconds[before]) / span : 1;
    return this.seconds[before] + share * (this.seconds[row] - this.seconds[before]);
  }

  // When the last block of a line ends; null where it has none.
  whenLine(line) {
    const row = this.line.lastIndexOf(line);
    return row < 0 ? null : this.seconds[row];
  }

  // When a setup's last move is made.
  endOf(setup) {
    const row = this.setup.lastIndexOf(setup);
    return row < 0 ? this.duration : this.seconds[row];
  }

  rowWhere(fits) {
    for (let k = 0; k < this.count; k++) if (fits(k)) return k;
    return -1;
  }
}

return { UNMOVED, times, shift, rigid, inverse, apply, stand, Motion };

})();

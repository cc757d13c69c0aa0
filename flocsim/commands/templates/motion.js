'use strict';

// Links the words of the glossary where they stand first in a text, and hides those without use.
const words = new Map();
for (const dt of document.querySelectorAll('.words dt')) {
  dt.id = 'word-' + dt.textContent.replace(/[^\p{L}\p{N}]+/gu, '-');
  for (const word of dt.textContent.split(', ')) words.set(word, dt);
}
// These are words only where they stand alone, as in the head of a column.
const alone = (word) => word.length === 1 || word === 'other';
const long = [...words.keys()].filter((word) => !alone(word)).sort((a, b) => b.length - a.length)
  .map((word) => word.replace(/[[\]]/g, '\\$&'));
const pattern = new RegExp(`(?<![\\w\\[])(${long.join('|')})s?(?![\\w\\]])`, 'g');
const used = new Set();
function link(element) {
  const seen = new Set(), whole = element.textContent.trim();
  element.innerHTML = element.innerHTML.replace(words.has(whole) ? whole : pattern, (text, word) => {
    const dt = words.get(words.has(whole) ? whole : word);
    if (seen.has(dt) || dt.nextElementSibling === element) return text;
    seen.add(dt); used.add(dt);
    return `<a class="word" href="#${dt.id}">${text}</a>`;
  });
}
document.querySelectorAll('header p:not(.file), h1, figcaption, th, dl.facts dt, section > p')
  .forEach(link);
for (const dt of used) link(dt.nextElementSibling);  // words that definitions use join them
for (const dt of document.querySelectorAll('.words dt')) {
  if (!used.has(dt)) { dt.nextElementSibling.remove(); dt.remove(); }
}

function svg(name, attributes, parent) {
  const element = document.createElementNS('http://www.w3.org/2000/svg', name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  parent?.append(element);
  return element;
}

// The largest of 1, 2, 5 times a power of ten that is not above a length.
function round(length) {
  const power = 10 ** Math.floor(Math.log10(length));
  return power * [5, 2, 1].find((step) => step * power <= length * 1.000001);
}

// A drawing of bodies whose centroids are at the origin until they are placed; [left, top, width,
// height] in µm, y up.
function drawing(data, [left, top, width, height], name) {
  const root = svg('svg', {viewBox: [left, top, width, height].join(' '), role: 'img',
    'aria-label': 'the ' + name, class: name});
  const up = svg('g', {transform: 'scale(1,-1)'}, root), view = svg('g', {}, up);
  const bodies = data.paths.map((d) => svg('path', {d, class: 'body', 'fill-rule': 'evenodd'}, view));
  const length = round(width / 4), y = top + 0.97 * height, x = left + 0.03 * width;
  svg('path', {d: `M${x},${y}h${length}`, stroke: 'currentColor', 'stroke-width': width / 120}, root);
  svg('text', {x, y: y - width / 70, 'font-size': width / (data.box ? 28 : 18), fill: 'currentColor'}, root)
    .textContent = `${length} µm`;
  return {root, up, view, bodies};
}

// The centre distance against time; returns a function that marks a frame.
function graph(data, panel) {
  const W = 340, H = 220, [left, right, top, bottom] = [52, 330, 12, 178];
  const root = svg('svg', {viewBox: `0 0 ${W} ${H}`, class: 'graph', role: 'img',
    'aria-label': 'centre distance against time'}, panel);
  const times = data.t.map((t) => t * data.unit[1]), all = [...data.distance, data.zone ?? data.distance[0]];
  const pad = 0.06 * (Math.max(...all) - Math.min(...all)) || 1;
  const low = Math.min(...all) - pad, high = Math.max(...all) + pad;
  const X = (t) => left + (right - left) * (t - times[0]) / (times.at(-1) - times[0] || 1);
  const Y = (d) => bottom - (bottom - top) * (d - low) / (high - low);
  const write = (words, x, y, anchor) => {
    svg('text', {x, y, 'text-anchor': anchor}, root).textContent = words;
  };
  if (data.zone !== null) {
    const level = Y(data.zone);
    svg('rect', {x: left, y: level, width: right - left, height: bottom - level, class: 'zone'}, root);
    write(`D₀ = ${data.zone.toPrecision(4)} µm`, right, level - 4, 'end');
  }
  for (const [from, to, across] of [[times[0], times.at(-1), true], [low, high, false]]) {
    const step = round((to - from) / 3);
    for (let k = Math.ceil(from / step); k * step <= to; k += 1) {
      const tick = Number((k * step).toPrecision(6));
      if (across) {
        svg('path', {d: `M${X(tick)},${bottom}v4`, class: 'axis'}, root);
        write(tick, X(tick), bottom + 17, 'middle');
      } else {
        svg('path', {d: `M${left},${Y(tick)}h-4`, class: 'axis'}, root);
        write(tick, left - 7, Y(tick) + 4, 'end');
      }
    }
  }
  svg('path', {d: `M${left},${top}V${bottom}H${right}`, class: 'axis'}, root);
  const line = times.map((t, k) => `${X(t).toFixed(1)},${Y(data.distance[k]).toFixed(1)}`);
  svg('path', {d: 'M' + line.join(' '), class: 'line'}, root);
  write(`time [${data.unit[0]}]`, (left + right) / 2, H - 6, 'middle');
  svg('text', {transform: `translate(12,${(top + bottom) / 2}) rotate(-90)`, 'text-anchor': 'middle'},
    root).textContent = 'centre distance [µm]';
  const dot = svg('circle', {r: 4, class: 'now'}, root);
  return (k) => { dot.setAttribute('cx', X(times[k])); dot.setAttribute('cy', Y(data.distance[k])); };
}

// A pair, seen from its first body: returns a function that shows a frame.
function pair(data, panel) {
  const half = data.half;
  const {root, view, bodies} = drawing(data, [-half, -half, 2 * half, 2 * half], 'pair');
  panel.append(root);
  const mark = graph(data, panel), contacts = svg('g', {class: 'contacts', fill: 'none'}, view);
  bodies.forEach((body, n) => {
    body.style.fill = body.style.stroke = data.colour[0][n];
    body.setAttribute('stroke-width', half / 160);
  });
  return (k) => {
    bodies.forEach((body, n) => {
      const [x, y, angle] = data.pose[k][n];
      body.setAttribute('transform', `translate(${x},${y}) rotate(${angle})`);
    });
    view.setAttribute('transform', `translate(${-data.eye[k][0]},${-data.eye[k][1]})`);
    contacts.replaceChildren(...data.contacts[k].map(([cx, cy]) =>
      svg('circle', {cx, cy, r: 0.03 * half, 'stroke-width': half / 110})));
    mark(k);
  };
}

// A swarm in its box, which may repeat itself: returns a function that shows a frame.
function swarm(data, panel) {
  const [width, height] = data.box, [wide, high] = data.repeats;
  const {root, up, view, bodies} = drawing(data, [0, -height, width, height], 'swarm');
  panel.append(root);
  // Copies beside the box show what crosses its sides.
  view.id = `swarm${document.querySelectorAll('.motion svg').length}`;
  for (const x of wide ? [0, -wide, wide] : [0]) {
    for (const y of high ? [0, -high, high] : [0]) if (x || y) svg('use', {href: '#' + view.id, x, y}, up);
  }
  bodies.forEach((body) => {
    body.setAttribute('stroke-width', width / 900);
  });
  const inside = (x, side) => side ? x - side * Math.floor(x / side) : x;
  return (k) => {
    // Between two snapshots, bodies go straight from one place to the next.
    const now = Math.floor(k / data.between), u = k / data.between - now;
    const after = data.pose[now + 1] ?? data.pose[now];
    bodies.forEach((body, n) => {
      const a = data.pose[now][n], b = after[n] ?? a;
      body.style.display = a ? '' : 'none';
      if (!a) return;
      const [x, y, angle] = a.map((value, axis) => value + u * (b[axis] - value));
      const [px, py] = data.fixed[n] ? [x, y] : [inside(x, wide), inside(y, high)];
      body.setAttribute('transform', `translate(${px},${py}) rotate(${angle})`);
      body.setAttribute('fill', data.colour[now][n]);
    });
  };
}

function make(name, properties, parent) {
  const element = Object.assign(document.createElement(name), properties);
  parent.append(element);
  return element;
}

for (const motion of document.querySelectorAll('.motion[data-frames^="{"]')) {
  const data = JSON.parse(motion.dataset.frames);
  const panels = make('div', {className: 'panels'}, motion);
  const draw = (data.box ? swarm : pair)(data, panels);
  const last = (data.t.length - 1) * data.between;
  const controls = make('div', {className: 'controls'}, motion);
  const button = make('button', {type: 'button', textContent: 'Play'}, controls);
  const slider = make('input', {type: 'range', min: 0, max: last, ariaLabel: 'frame'}, controls);
  const speed = make('select', {ariaLabel: 'speed'}, controls);
  for (const value of [0.25, 0.5, 1, 2, 4]) {
    make('option', {value, textContent: `${value}×`, selected: value === 1}, speed);
  }
  const output = make('output', {}, controls);
  let frame, timer = null;
  function show(k) {
    frame = k; slider.value = k;
    draw(k);
    output.textContent = data.words[Math.floor(k / data.between)];
  }
  function stop() { clearTimeout(timer); timer = null; button.textContent = 'Play'; }
  function step() {
    show(frame >= last ? 0 : frame + 1);
    timer = setTimeout(step, (frame >= last ? 1500 : 60) / Number(speed.value));
  }
  button.addEventListener('click', () => {
    if (timer) { stop(); } else { button.textContent = 'Pause'; step(); }
  });
  slider.addEventListener('input', () => { stop(); show(Number(slider.value)); });
  show(data.shown * data.between);
}

for (const motion of document.querySelectorAll('.motion[data-frames]')) {
  const data = JSON.parse(motion.dataset.frames), between = data.between, count = data.pose.length;
  const bodies = motion.querySelectorAll('.body'), rings = motion.querySelector('.contacts');
  const view = motion.querySelector('.view'), dot = motion.querySelector('.now');
  const slider = motion.querySelector('input'), words = motion.querySelector('output');
  const button = motion.querySelector('button'), speed = motion.querySelector('select');
  const last = (count - 1) * between;
  let frame = data.shown * between, timer = null;
  // A place of a body in a box that repeats itself is brought back into it.
  const inside = (x, side) => side ? x - side * Math.floor(x / side) : x;
  function show(k) {
    frame = k; slider.value = k;
    const now = Math.floor(k / between), next = Math.min(now + 1, count - 1), u = k / between - now;
    bodies.forEach((body, n) => {
      const a = data.pose[now][n], b = data.pose[next][n] ?? a;
      body.style.display = a ? '' : 'none';
      if (!a) return;
      let [x, y, angle] = a.map((value, axis) => value + u * (b[axis] - value));
      if (!body.classList.contains('wall')) {
        x = inside(x, data.repeats[0]); y = inside(y, data.repeats[1]);
      }
      body.setAttribute('transform', `translate(${x},${y}) rotate(${angle})`);
      if (data.colour.length) body.setAttribute('fill', data.colours[data.colour[now][n]]);
    });
    if (data.eye.length) {
      view.setAttribute('transform', `translate(${-data.eye[now][0]},${-data.eye[now][1]})`);
      rings.replaceChildren(...data.contacts[now].map(([x, y]) => {
        const ring = document.createElementNS('http://www.w3.org/2000/svg', 'circle');
        ring.setAttribute('cx', x); ring.setAttribute('cy', y); ring.setAttribute('r', data.ring);
        return ring;
      }));
      dot.setAttribute('cx', data.dot[now][0]); dot.setAttribute('cy', data.dot[now][1]);
    }
    words.textContent = data.words[now];
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
  show(frame);
}

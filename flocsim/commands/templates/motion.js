
for (const motion of document.querySelectorAll('.motion[data-frames]')) {
  const data = JSON.parse(motion.dataset.frames), count = data.t.length;
  const bodies = motion.querySelectorAll('.body'), rings = motion.querySelector('.contacts');
  const view = motion.querySelector('.view'), dot = motion.querySelector('.now');
  const slider = motion.querySelector('input'), words = motion.querySelector('output');
  const button = motion.querySelector('button');
  let frame = data.shown, timer = null;
  function show(k) {
    frame = k; slider.value = k;
    view.setAttribute('transform', `translate(${-data.eye[k][0]},${-data.eye[k][1]})`);
    bodies.forEach((body, n) => {
      const [x, y, angle] = data.pose[k][n];
      body.setAttribute('transform', `translate(${x},${y}) rotate(${angle})`);
    });
    rings.replaceChildren(...data.contacts[k].map(([x, y]) => {
      const ring = document.createElementNS('http://www.w3.org/2000/svg', 'circle');
      ring.setAttribute('cx', x); ring.setAttribute('cy', y); ring.setAttribute('r', data.ring);
      return ring;
    }));
    dot.setAttribute('cx', data.dot[k][0]); dot.setAttribute('cy', data.dot[k][1]);
    words.textContent = data.words[k];
  }
  function stop() { clearTimeout(timer); timer = null; button.textContent = 'Play'; }
  function step() {
    const last = frame + 1 >= count;
    show(last ? 0 : frame + 1);
    timer = setTimeout(step, frame + 1 >= count ? 1500 : 60);
  }
  button.addEventListener('click', () => {
    if (timer) { stop(); } else { button.textContent = 'Pause'; step(); }
  });
  slider.addEventListener('input', () => { stop(); show(Number(slider.value)); });
  show(frame);
}

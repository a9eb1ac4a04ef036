"""One time cursor for all plots of a page: a line at the same time in every plot of the same recording.

It needs nothing but the attribute ``data-time-axes`` on the pictures' frames (see `time_axes`); without scripts, and on
paper, the pictures are plain. Others on the page join in by two events of the document, both with the detail
``{recording, time}``: ``timechosen`` comes from here, ``timeplayed`` goes to here.
"""

STYLE = """
.cursor{position:absolute;width:1px;background:#7a3f66;pointer-events:none}
.cursor span{position:absolute;bottom:100%;left:-2px;max-width:20rem;overflow:hidden;text-overflow:ellipsis;
white-space:nowrap;padding:0 .3rem;background:rgba(255,255,255,.88);color:#7a3f66;font-size:.75rem;line-height:1.3;
font-weight:600;font-variant-numeric:tabular-nums}
.cursor.left span{left:auto;right:-2px}
.cursor span:empty{display:none}
.times{position:absolute;cursor:crosshair;border-radius:.2rem}
.times:focus-visible{outline:2px solid #00588f;outline-offset:2px}
@media print{.cursor,.times{display:none}}
"""

SCRIPT = """
(() => {
  const STEPS = 200, LEAP = 10;  // Steps of an arrow key over a plot, and arrow keys in a page key.
  const lines = [], sliders = [], chosen = new Map();
  const percent = share => 100 * share + "%";
  const added = (parent, tag, name) => {
    const element = parent.appendChild(document.createElement(tag));
    element.className = name;
    return element;
  };
  const words = (time, {from, to, recording}) => {
    const digits = Math.min(6, Math.max(0, Math.ceil(3 - Math.log10(to - from))));
    return time.toFixed(digits) + " s" + (recording && ", " + recording);
  };

  const show = (recording, time) => {
    const named = new Set();  // Of a plot's lines the first that is seen bears the text.
    for (const line of lines.filter(line => line.recording === recording)) {
      const share = (time - line.from) / (line.to - line.from);
      line.element.hidden = !(share >= 0 && share <= 1);
      if (line.element.hidden) continue;
      const [left, , width] = line.box;
      line.element.style.left = percent(left + share * width);
      line.element.classList.toggle("left", left + share * width > 0.6);
      line.text.textContent = named.has(line.plot) ? "" : words(time, line.slider);
      named.add(line.plot);
    }
    for (const slider of sliders.filter(slider => slider.recording === recording)) {
      const known = time !== undefined;
      slider.element.ariaValueNow = Math.min(slider.to, Math.max(slider.from, known ? time : slider.from));
      slider.element.ariaValueText = known ? words(time, slider) : "no time chosen";
    }
  };
  const restore = recording => show(recording, chosen.get(recording));
  const keep = (recording, time) => { chosen.set(recording, time); restore(recording); };
  const choose = (recording, time) => {
    keep(recording, time);
    document.dispatchEvent(new CustomEvent("timechosen", {detail: {recording, time}}));
  };

  // What the keyboard and a screen reader take hold of: over all axes of one recording in one plot.
  const addSlider = (plot, recording, group) => {
    const edge = (pick, side) => pick(...group.map(side));
    const left = edge(Math.min, a => a.box[0]), right = edge(Math.max, a => a.box[0] + a.box[2]);
    const top = edge(Math.min, a => a.box[1]), bottom = edge(Math.max, a => a.box[1] + a.box[3]);
    const element = added(plot, "div", "times");
    const slider = {element, recording, from: edge(Math.min, a => a.limits[0]), to: edge(Math.max, a => a.limits[1])};
    Object.assign(element.style, {
      left: percent(left), top: percent(top), width: percent(right - left), height: percent(bottom - top),
    });
    element.tabIndex = 0;
    element.role = "slider";
    element.ariaLabel = "Time in: " + plot.querySelector("img").alt;
    element.ariaValueMin = slider.from;
    element.ariaValueMax = slider.to;
    sliders.push(slider);
    element.addEventListener("keydown", event => {
      const step = (slider.to - slider.from) / STEPS;
      const moves = {
        ArrowRight: step, ArrowUp: step, ArrowLeft: -step, ArrowDown: -step,
        PageUp: LEAP * step, PageDown: -LEAP * step, Home: -Infinity, End: Infinity,
      };
      if (!(event.key in moves)) return;
      event.preventDefault();
      const time = (chosen.get(recording) ?? slider.from) + moves[event.key];
      choose(recording, Math.min(slider.to, Math.max(slider.from, time)));
    });
    return slider;
  };

  for (const plot of document.querySelectorAll("[data-time-axes]")) {
    const all = JSON.parse(plot.dataset.timeAxes), own = [];
    for (const recording of new Set(all.map(a => a.recording))) {
      const group = all.filter(a => a.recording === recording);
      const slider = addSlider(plot, recording, group);
      for (const {box, limits: [from, to]} of group) {
        const element = added(plot, "div", "cursor");
        element.style.top = percent(box[1]);
        element.style.height = percent(box[3]);
        own.push({plot, slider, recording, box, from, to, element, text: added(element, "span", "")});
      }
      lines.push(...own.filter(line => line.recording === recording));
      restore(recording);
    }
    let under;  // The recording whose axes the pointer is over.
    const leave = () => { if (under !== undefined) restore(under); under = undefined; };
    const follow = event => {
      const frame = plot.getBoundingClientRect();
      const x = (event.clientX - frame.left) / frame.width, y = (event.clientY - frame.top) / frame.height;
      const line = own.find(({box: [left, top, width, height]}) =>
        x >= left && x <= left + width && y >= top && y <= top + height);
      if (line?.recording !== under) leave();
      if (!line) return;
      under = line.recording;
      const time = line.from + (x - line.box[0]) / line.box[2] * (line.to - line.from);
      (event.buttons & 1 ? choose : show)(under, time);
    };
    plot.addEventListener("pointerdown", follow);
    plot.addEventListener("pointermove", follow);
    plot.addEventListener("pointerleave", leave);
  }
  document.addEventListener("timeplayed", ({detail: {recording, time}}) => keep(recording, time));
})();
"""

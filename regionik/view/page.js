"use strict";
// What the page does beside MeshCat's viewer: time bar, curves, read-outs, layers, views, names of things.
// `page` (see viewer.page_document) and `commands` (the scene) stand in the page before this script.

const $ = (id) => document.getElementById(id);
const stage = $("stage"), pane = $("meshcat-pane"), tip = $("tip");
const motion = page.motion, still = motion === null;

// Without WebGL nothing is drawn and the page says so; whatever is written on it works on.
function viewerIn(element) {
  try {
    return new MeshCat.Viewer(element);
  } catch {
    document.body.classList.add("undrawn");
    $("undrawn").textContent = "This browser has no WebGL, so the scene is not drawn. "
      + (still ? "The words beside it are" : "The words beside it, the time bar, the figures and the curves work")
      + " as ever. To see it, turn on hardware acceleration in the browser's settings, or open the page in another one.";
    return new MeshCat.Viewer(element, true, { domElement: element, setPixelRatio() {}, setSize() {}, render() {} });
  }
}

const viewer = viewerIn(pane);
for (const command of commands) viewer.handle_command_bytearray(Uint8Array.from(atob(command), (c) => c.charCodeAt(0)));

const COLORS = ["#1b3f8b", "#d1495b", "#12a347", "#e08a00", "#7b4fc9", "#00838f", "#8a5a2b", "#5f6b76", "#c2185b", "#6b8e00"];

// --- the scene: nodes by path, layers, names

const nodeOf = (path) => viewer.scene_tree.find(["meshcat", ...path.split("/"), "<object>"]).object;

function shown(object) {
  for (let node = object; node; node = node.parent) if (!node.visible) return false;
  return true;
}

function addLayers() {
  for (const layer of page.layers) {
    const line = document.createElement("label"), box = document.createElement("input"), swatch = document.createElement("i");
    box.type = "checkbox";
    box.checked = true;
    swatch.style.background = layer.color;
    line.append(box, swatch, layer.label);
    box.addEventListener("change", () => {
      for (const path of layer.paths) nodeOf(path).visible = box.checked;
      line.classList.toggle("off", !box.checked);
      viewer.set_dirty();
    });
    $("layers").append(line);
  }
  const note = document.createElement("p");
  note.textContent = "Areas are places of the arm's vertical axis.";
  note.style.marginTop = "6px";
  $("layers").append(note);
}

// The name of what is seen at a point of the window, and its set-point from 0; null where nothing is.
function nameAt(x, y) {
  const box = pane.getBoundingClientRect(), caster = new MeshCat.THREE.Raycaster();
  caster.setFromCamera({ x: (2 * (x - box.left)) / box.width - 1, y: 1 - (2 * (y - box.top)) / box.height }, viewer.camera);
  const things = Object.keys(page.names).map((path) => [path, nodeOf(path)]);
  const hits = things
    .filter(([, object]) => shown(object))
    .flatMap(([path, object]) => caster.intersectObject(object, false).map((hit) => ({ path, hit })));
  if (!hits.length) return null;
  const nearest = Math.min(...hits.map(({ hit }) => hit.distance));
  const { path, hit } = hits // of what lies flat on the floor, the layer drawn last
    .filter((one) => one.hit.distance < nearest + 1e-3)
    .reduce((a, b) => (b.hit.object.renderOrder > a.hit.object.renderOrder ? b : a));
  const [name, numbers] = page.names[path], geometry = hit.object.geometry;
  const faces = (geometry.index ?? geometry.attributes.position).count / 3;
  const setpoint = numbers.length ? numbers[Math.floor((hit.faceIndex * numbers.length) / faces)] : null;
  return { name: setpoint === null ? name : `${name} ${setpoint + 1}${called(setpoint)}`, setpoint };
}

// What people call a set-point, from 0, after a comma; nothing where it has no name.
const called = (setpoint) => (page.setpoints[setpoint] ? `, ${page.setpoints[setpoint]}` : "");

function tell(event) {
  const found = nameAt(event.clientX, event.clientY), box = stage.getBoundingClientRect();
  tip.hidden = found === null;
  if (found === null) return;
  tip.textContent = found.name;
  tip.style.left = `${event.clientX - box.left + 12}px`;
  tip.style.top = `${event.clientY - box.top - 30}px`;
  if (found.setpoint !== null && !still) jump(found.setpoint);
}

// --- views

const camera = viewer.camera, start = { position: camera.position.clone(), zoom: camera.zoom };
const ASPECT = 1.45; // that the camera was placed for
const NARROW = 900; // window in which the cards would hide the scene [pixels]
let above = false;

function look() {
  const width = stage.clientWidth, height = stage.clientHeight;
  const cards = width < NARROW ? 0 : $("legend").offsetWidth + $("readout").offsetWidth; // in the upper corners
  const aspect = (width - Math.min(cards, width) / 2) / height;
  const tall = Math.tan((camera.fov * Math.PI) / 360), [x, y] = page.half;
  if (above) {
    const far = 12 * Math.max(x, y, 1); // from afar heights are hardly seen aslant
    camera.position.set(0, far, 1e-3 * far);
    camera.zoom = (far * tall) / (1.08 * Math.max(y, x / aspect));
    camera.far = 3 * far;
  } else {
    camera.position.copy(start.position);
    camera.zoom = start.zoom * Math.min(1, aspect / ASPECT);
  }
  viewer.controls.target.set(0, 0, 0);
  viewer.controls.update();
  $("top").textContent = above ? "view in perspective" : "view from above";
  viewer.set_dirty();
}

function resize() {
  viewer.set_3d_pane_size(stage.clientWidth, stage.clientHeight);
  for (const track of tracks) track.draw();
  if (!still) show();
}

// --- time

const player = { time: 0, speed: 1, playing: !still, last: null };
const end = still ? 0 : motion.times[motion.times.length - 1];
const REST = 1.5; // at the end, before the motion starts again [s]

function seek(time) {
  player.time = Math.max(0, Math.min(end, time));
  viewer.animator.seek(player.time);
  show();
}

function play(on) {
  player.playing = on;
  player.last = null;
  if (on && player.time >= end) player.time = 0;
  $("play").textContent = on ? "pause" : "play";
}

function tick(now) {
  if (player.playing && player.last !== null) {
    const next = player.time + (player.speed * (now - player.last)) / 1000;
    player.rested = next < end ? 0 : (player.rested || 0) + (now - player.last) / 1000;
    seek(player.rested > REST ? 0 : next);
  }
  player.last = now;
  requestAnimationFrame(tick);
}

// The next set-point that is not passed yet, from 0; the last one at the end.
const nextSetpoint = () => {
  const i = motion.setpoints.findIndex((time) => time >= player.time - 1e-4);
  return i < 0 ? motion.setpoints.length - 1 : i;
};

function jump(i) {
  play(false);
  seek(motion.setpoints[Math.max(0, Math.min(motion.setpoints.length - 1, i))]);
}

function step(by) {
  const i = nextSetpoint(), here = Math.abs(motion.setpoints[i] - player.time) < 1e-4;
  jump(by < 0 ? i - 1 : here ? i + 1 : i);
}

// A curve's value at the time shown; null where there is none.
function valueAt(times, values) {
  let low = 0, high = times.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= player.time) low = middle;
    else high = middle;
  }
  const a = values[low], b = values[high];
  if (a === null || b === null || high === low) return a;
  const span = times[high] - times[low];
  return a + (b - a) * Math.max(0, Math.min(1, span > 0 ? (player.time - times[low]) / span : 0));
}

// --- the time bar, and curves over it

const tracks = [];

class Track {
  constructor(element, height) {
    this.element = element;
    this.canvas = element.querySelector("canvas");
    this.cursor = element.querySelector(".cursor");
    const follow = (event) => {
      play(false);
      const box = element.getBoundingClientRect();
      seek((end * (event.clientX - box.left)) / box.width);
    };
    element.addEventListener("pointerdown", (event) => {
      element.setPointerCapture(event.pointerId);
      follow(event);
    });
    element.addEventListener("pointermove", (event) => event.buttons && follow(event));
    tracks.push(this);
  }

  // The canvas, cleared; x(time) and its size in pixels of the page.
  begin() {
    const { clientWidth: width, clientHeight: height } = this.element, ratio = window.devicePixelRatio;
    this.canvas.width = width * ratio;
    this.canvas.height = height * ratio;
    const pen = this.canvas.getContext("2d");
    pen.scale(ratio, ratio);
    return { pen, width, height, x: (time) => (end > 0 ? (width * time) / end : 0) };
  }

  point() {
    this.cursor.style.left = `${end > 0 ? (100 * player.time) / end : 0}%`;
  }
}

class Bar extends Track {
  draw() {
    const { pen, width, height, x } = this.begin();
    pen.fillStyle = "#dfe5ea";
    pen.fillRect(0, height / 2 - 3, width, 6);
    pen.fillStyle = "#9b30d9";
    for (const [from, to] of motion.lifted) pen.fillRect(x(from), height / 2 - 3, Math.max(1, x(to) - x(from)), 6);
    pen.fillStyle = "#ff8a1f";
    for (const time of motion.setpoints) pen.fillRect(x(time) - 0.75, height / 2 - 7, 1.5, 14);
  }
}

class Curves extends Track {
  constructor(element, words, values, times, title, unit, curves) {
    super(element);
    const all = curves.flatMap(([, column]) => column).filter((value) => value !== null);
    Object.assign(this, { values, times, curves, low: Math.min(0, ...all), high: Math.max(...all, 1e-3) });
    for (const text of [this.high.toFixed(2), `${title} [${unit}]`, this.low.toFixed(2)]) {
      const line = document.createElement("span");
      line.textContent = text;
      words.append(line);
    }
  }

  draw() {
    const { pen, width, height, x } = this.begin();
    const { low, high } = this;
    const y = (value) => 4 + ((height - 8) * (high - value)) / (high - low);
    pen.fillStyle = "rgba(155, 48, 217, .1)";
    for (const [from, to] of motion.lifted) pen.fillRect(x(from), 0, x(to) - x(from), height);
    pen.fillStyle = "#c6ccd2";
    pen.fillRect(0, y(0), width, 1);
    this.curves.forEach(([, column], k) => {
      pen.strokeStyle = COLORS[k % COLORS.length];
      pen.lineWidth = 1.3;
      pen.beginPath();
      let drawing = false;
      column.forEach((value, i) => {
        if (value !== null) pen[drawing ? "lineTo" : "moveTo"](x(this.times[i]), y(value));
        drawing = value !== null;
      });
      pen.stroke();
    });
  }

  point() {
    super.point();
    this.values.replaceChildren(
      ...this.curves.flatMap(([name, column], k) => {
        const label = document.createElement("span"), number = document.createElement("span");
        const value = valueAt(this.times, column);
        label.style.color = number.style.color = COLORS[k % COLORS.length];
        label.textContent = name.replace(/_joint$/, "");
        number.textContent = value === null ? "-" : value.toFixed(3);
        return [label, number];
      })
    );
  }
}

function addCurves(title, unit, times, curves) {
  if (!curves.length) return;
  const row = document.createElement("div");
  row.className = "row";
  row.innerHTML = '<span class="scale"></span><div class="track"><canvas></canvas><div class="cursor"></div></div><span class="values"></span>';
  $("curves").append(row);
  new Curves(row.children[1], row.children[0], row.children[2], times, title, unit, curves);
}

// --- read-outs

const degrees = (angle) => `${(((((angle * 180) / Math.PI + 180) % 360) + 360) % 360 - 180).toFixed(1)}\u00b0`;

function readouts() {
  const i = nextSetpoint(), here = Math.abs(motion.setpoints[i] - player.time) < 1e-4, passed = player.time > motion.setpoints[i];
  const rows = [[here ? "at set-point" : passed ? "after set-point" : "next set-point", `${i + 1} of ${motion.setpoints.length}${called(i)}`]];
  rows.push([motion.timed ? "time" : "time (not timed)", `${player.time.toFixed(2)} s`]);
  if (motion.areas.length) {
    rows.push(["area", `${motion.areas[i][0].toFixed(3)} m\u00b2`]);
    rows.push(["admissible", `${motion.areas[i][1].toFixed(3)} m\u00b2`]);
  }
  for (const [name, column] of Object.entries(motion.speeds)) rows.push([`${name} speed`, `${valueAt(motion.times, column).toFixed(3)} m/s`]);
  for (const [name, column] of Object.entries(motion.clearances)) {
    const value = valueAt(motion.measured, column);
    rows.push([name, value === null ? "-" : `${value.toFixed(3)} m`]);
  }
  const [x, y, yaw] = motion.base.map((column) => valueAt(motion.times, column));
  rows.push(["base", `${x.toFixed(3)}, ${y.toFixed(3)} m`], ["heading", degrees(yaw)]);
  motion.jointKinds.forEach(([name, kind], k) => {
    const value = valueAt(motion.times, motion.joints[k]);
    rows.push([name, kind === "revolute" ? degrees(value) : `${value.toFixed(3)} m`]);
  });
  return rows;
}

function show() {
  for (const track of tracks) track.point();
  $("bar").setAttribute("aria-valuetext", `${player.time.toFixed(2)} s`);
  $("clock").textContent = `${player.time.toFixed(2)} of ${end.toFixed(2)} s`;
  if (document.activeElement !== $("setpoint")) $("setpoint").value = nextSetpoint() + 1;
  const table = $("readout").firstElementChild;
  table.replaceChildren(
    ...readouts().map(([name, value], k) => {
      const row = document.createElement("tr"), head = document.createElement("th"), cell = document.createElement("td");
      head.textContent = name;
      cell.textContent = value;
      row.append(head, cell);
      if (k === 0) row.className = "head";
      return row;
    })
  );
}

// --- the whole

function toggle(element, button) {
  element.hidden = !element.hidden;
  button.setAttribute("aria-pressed", !element.hidden);
  resize();
  look();
}

const commandsByKey = {
  t: () => ((above = !above), look()),
  l: () => toggle($("legend"), $("show-legend")),
  ...(still ? {} : {
    " ": () => play(!player.playing),
    c: () => toggle($("curves"), $("show-curves")),
    ArrowLeft: () => step(-1),
    ArrowRight: () => step(1),
    Home: () => jump(0),
    End: () => jump(motion.setpoints.length - 1),
  }),
};

function addControls() {
  const press = (id, key) => $(id).addEventListener("click", (event) => (commandsByKey[key](), event.target.blur()));
  press("top", "t");
  press("show-legend", "l");
  if (!still) {
    press("show-curves", "c");
    press("play", " ");
    press("back", "ArrowLeft");
    press("on", "ArrowRight");
    $("speed").addEventListener("change", (event) => (player.speed = Number(event.target.value)));
    $("setpoint").addEventListener("change", (event) => (jump(Number(event.target.value) - 1), event.target.blur()));
  }
  document.addEventListener("keydown", (event) => {
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (event.target.tagName === "INPUT" && event.target.type === "number") return;
    if (event.target.tagName === "SELECT" || event.ctrlKey || event.metaKey || event.altKey || !commandsByKey[key]) return;
    event.preventDefault();
    commandsByKey[key]();
  });
  let pressed = null;
  pane.addEventListener("pointerdown", (event) => ((pressed = [event.clientX, event.clientY]), (tip.hidden = true)));
  pane.addEventListener("pointerup", (event) => {
    if (pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < 4) tell(event);
  });
  window.addEventListener("resize", () => (resize(), look()));
}

// For films: the scene and the time, without controls.
function film() {
  play(false);
  document.body.classList.add("film");
  resize();
  look();
}

function addMotion() {
  for (const action of viewer.animator.actions) action.play();
  for (const id of ["dock", "readout", "show-curves"]) $(id).hidden = false;
  $("setpoint").max = motion.setpoints.length;
  $("count").textContent = `of ${motion.setpoints.length}`;
  $("bar-words").textContent = motion.timed ? "time of the plan" : "not timed";
  new Bar($("bar"));
  addCurves("joints", "rad, m", motion.times, motion.jointKinds.map(([name], k) => [name, motion.joints[k]]));
  addCurves("speed", "m/s", motion.times, Object.entries(motion.speeds));
  addCurves("clearance", "m", motion.measured, Object.entries(motion.clearances));
  $("curves").hidden = window.innerHeight < 640;
  $("show-curves").setAttribute("aria-pressed", !$("curves").hidden);
}

$("legend").hidden = window.innerWidth < NARROW;
$("readout").classList.toggle("brief", window.innerWidth < NARROW);
$("readout").addEventListener("click", () => $("readout").classList.toggle("brief"));
$("show-legend").setAttribute("aria-pressed", !$("legend").hidden);
addLayers();
addControls();
if (!still) addMotion();
// After the viewer's own idea of its size, which is that of the window.
window.onload = () => (resize(), look());
requestAnimationFrame(() => {
  resize();
  look();
  if (still) return;
  seek(0);
  requestAnimationFrame(tick);
});

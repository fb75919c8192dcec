"use strict";
(function () {
  function cellValue(cell) {
    if (cell.dataset.v !== undefined) return parseFloat(cell.dataset.v);
    const text = cell.textContent.trim();
    const number = parseFloat(text.replace("−", "-"));
    return /^[−+\d.]/.test(text) && !isNaN(number) ? number : text.toLowerCase();
  }
  function compare(a, b) {
    if (typeof a === "number" && typeof b === "number") return a - b;
    if (typeof a === "number") return -1;
    if (typeof b === "number") return 1;
    return a < b ? -1 : a > b ? 1 : 0;
  }
  document.querySelectorAll("table.sortable").forEach(function (table) {
    const head = table.tHead.rows[table.tHead.rows.length - 1];
    Array.from(head.cells).forEach(function (th, index) {
      th.querySelector("button").addEventListener("click", function () {
        const down = th.getAttribute("aria-sort") === "ascending";
        Array.from(head.cells).forEach(function (other) { other.removeAttribute("aria-sort"); });
        th.setAttribute("aria-sort", down ? "descending" : "ascending");
        const rows = Array.from(table.tBodies[0].rows).map(function (row, order) {
          return { row: row, order: order, value: cellValue(row.cells[index]) };
        });
        rows.sort(function (a, b) {
          return (down ? -1 : 1) * compare(a.value, b.value) || a.order - b.order;
        });
        rows.forEach(function (item) { table.tBodies[0].appendChild(item.row); });
      });
    });
  });

  function drawable() {
    try {
      const canvas = document.createElement("canvas");
      return !!(window.DecompressionStream && window.WebGLRenderingContext && canvas.getContext("webgl"));
    } catch (error) {
      return false;
    }
  }
  async function unpack() {
    const text = atob(document.getElementById("plotly-source").textContent);
    const bytes = Uint8Array.from(text, function (letter) { return letter.charCodeAt(0); });
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    const script = document.createElement("script");
    script.textContent = await new Response(stream).text();
    document.head.appendChild(script);
  }
  let unpacked = null;
  function loadPlotly() {
    if (unpacked === null) unpacked = unpack();
    return unpacked;
  }
  const COLOURS = { axis: "#8a97a3", strand1: "#1f5fa8", strand2: "#b4511f" };
  function traces(ring) {
    return ring.curves.map(function (curve) {
      const xyz = [0, 1, 2].map(function (k) { return curve.points.map(function (p) { return p[k]; }); });
      const trace = {
        type: "scatter3d", x: xyz[0], y: xyz[1], z: xyz[2], name: curve.label, hoverinfo: "name"
      };
      const colour = COLOURS[curve.part] || curve.colour || "#1f5fa8";
      if (curve.style === "beads") {
        trace.mode = "markers";
        trace.marker = { size: curve.part === "axis" ? 1.5 : 3, color: colour };
      } else {
        trace.mode = "lines";
        trace.line = { width: curve.part === "axis" ? 2 : 5, color: colour };
        trace.opacity = 0.75;
      }
      return trace;
    });
  }
  async function show(stage, ring) {
    await loadPlotly();
    const wait = stage.querySelector("p.wait");
    if (wait) wait.remove();
    const axis = { visible: false };
    Plotly.react(stage, traces(ring), {
      margin: { l: 0, r: 0, t: 0, b: 0 }, showlegend: stage.clientWidth > 600,
      legend: { x: 1, xanchor: "right", y: 1, bgcolor: "rgba(255,255,255,0.7)" },
      scene: { aspectmode: "data", xaxis: axis, yaxis: axis, zaxis: axis, camera: { eye: { x: 0.15, y: -1.05, z: 1.85 }, up: { x: 0, y: 1, z: 0 } } },
      uirevision: "keep", width: stage.clientWidth, height: stage.clientHeight
    }, { displaylogo: false, displayModeBar: false });
  }
  document.querySelectorAll("select.rings-choice").forEach(function (select) {
    const id = select.dataset.for;
    const stage = document.getElementById(id + "-stage");
    const rings = JSON.parse(document.getElementById(id + "-data").textContent);
    if (!drawable()) {
      stage.querySelector("p.wait").textContent = "This browser can't draw in three dimensions (WebGL is off).";
      select.disabled = true;
      return;
    }
    let started = false;
    function update() {
      show(stage, rings[Number(select.value)]).then(function () { started = true; });
    }
    select.addEventListener("change", update);
    window.addEventListener("resize", function () {
      if (started) Plotly.relayout(stage, { width: stage.clientWidth, height: stage.clientHeight });
    });
    if ("IntersectionObserver" in window) {
      const observer = new IntersectionObserver(function (entries) {
        if (entries.some(function (entry) { return entry.isIntersecting; })) {
          observer.disconnect();
          update();
        }
      }, { rootMargin: "200px" });
      observer.observe(stage);
    } else {
      update();
    }
  });
  window.addEventListener("beforeprint", function () {
    document.querySelectorAll("details").forEach(function (item) { item.open = true; });
  });
})();

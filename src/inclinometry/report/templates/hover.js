(function () {
"use strict";
// the value of the point under the pointer: places stand in the figure, values in the CSV below it
var tip = document.createElement("div");
tip.className = "tip"; tip.hidden = true; tip.setAttribute("role", "status");
document.body.appendChild(tip);

function table(link) {
  var text = decodeURIComponent(link.href.slice(link.href.indexOf(",") + 1)), rows = [[""]], quoted = false;
  for (var k = 0; k < text.length; k += 1) {
    var row = rows[rows.length - 1], c = text[k];
    if (c === '"') { if (quoted && text[k + 1] === '"') { row[row.length - 1] += c; k += 1; } else { quoted = !quoted; } }
    else if (c === "," && !quoted) { row.push(""); }
    else if (c === "\n" && !quoted) { rows.push([""]); }
    else { row[row.length - 1] += c; }
  }
  return rows;
}

document.querySelectorAll("figure[data-at]").forEach(function (figure) {
  var svg = figure.querySelector("svg"), rows = null, spot = null;
  var places = figure.getAttribute("data-at").split(" ").map(function (p) { return p.split(",").map(Number); });
  function hide() { tip.hidden = true; if (spot) { spot.remove(); spot = null; } }
  svg.addEventListener("pointermove", function (event) {
    var to = svg.getScreenCTM();
    if (!to) { return; }
    var here = new DOMPoint(event.clientX, event.clientY).matrixTransform(to.inverse()), best = 14 / to.a, found = -1;
    places.forEach(function (p, k) {
      var away = Math.hypot(p[0] / 10 - here.x, p[1] / 10 - here.y);
      if (away < best) { best = away; found = k; }
    });
    hide();
    if (found < 0) { return; }
    rows = rows || table(figure.querySelector(".data a"));
    var head = rows[0], row = rows[found + 1];
    tip.textContent = (row[0] ? row[0] + "\n" : "") + head[1] + ": " + row[1] + "\n" + head[2] + ": " + row[2]
      + (row[3] ? (head[3] === "±" ? " ± " : "\n" + head[3] + ": ") + row[3] : "");
    tip.hidden = false;
    tip.style.left = Math.max(4, Math.min(event.clientX + 14, window.innerWidth - tip.offsetWidth - 8)) + "px";
    tip.style.top = (event.clientY + 18 + tip.offsetHeight > window.innerHeight ? event.clientY - 12 - tip.offsetHeight
      : event.clientY + 18) + "px";
    spot = document.createElementNS(svg.namespaceURI, "circle");
    spot.setAttribute("cx", places[found][0] / 10); spot.setAttribute("cy", places[found][1] / 10);
    spot.setAttribute("r", 5); spot.setAttribute("class", "spot");
    svg.appendChild(spot);
  });
  svg.addEventListener("pointerleave", hide);
});
}());

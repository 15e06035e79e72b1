// Comfort only: every page works without it.
"use strict";

// One click sends once; the server would keep one answer of two in any case.
for (const form of document.forms) {
  form.addEventListener("submit", (event) => {
    if (form.dataset.sent) event.preventDefault();
    form.dataset.sent = "yes";
  });
}
window.addEventListener("pageshow", () => {
  for (const form of document.forms) delete form.dataset.sent;
});

// A play button: two films play together, and no control lies over a face.
const films = [...document.querySelectorAll("form video")];
const play = document.querySelector("button.play");
if (play && films.length) {
  play.hidden = false;
  for (const film of films) film.controls = false;
  play.addEventListener("click", () => {
    for (const film of films) {
      film.currentTime = 0;
      film.play();
    }
  });
}

// A private link is shown whole, so that it can be copied.
for (const link of document.querySelectorAll("a.private")) link.textContent = link.href;

// After a mistake, the list of what is missing is read first.
const mistakes = document.getElementById("mistakes");
if (mistakes) mistakes.focus();

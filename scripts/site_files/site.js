// Formulas are typeset wherever a page is shown, also behind a link that loads no new document.
document.addEventListener("DOMContentLoaded", () => {
  renderMathInElement(document.body, { delimiters: [{ left: "\\(", right: "\\)", display: false }, { left: "\\[", right: "\\]", display: true }] });
});

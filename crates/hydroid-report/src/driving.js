// The driving view of a report.
{
  const { vessel, trials, comparisons } = JSON.parse(document.getElementById("vessel").textContent);
  const box = document.getElementById("driving");
  if (vessel.motion === null) box.textContent = vessel.not_driven;
  else {
    for (const note of vessel.notes) box.before(make("p", { className: "nothing", text: note }));
    if (vessel.not_steered) box.before(make("p", { className: "nothing", text: vessel.not_steered }));
    const view = new DriveView(box, vessel, trials.map((one) => ({ text: one.title, run: () => trialsShown([one], vessel) })));
    if (comparisons.length) view.addTrials(comparisons.map((one) => ({ text: one.title, run: () => comparisonShown(one) })), DRIVE_TEXT.inLogs);
    view.start();
  }
}

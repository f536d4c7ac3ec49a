/* Data of a recorded run, which the page contains. */
addPart(page);
begin();

% Simulates the exported model over a record, record.csv, with flow.m from `host-fit codegen --lang matlab -o flow.m`.
record = dlmread('record.csv', ',', 1, 0); % t, u, y
y = flow(record(:, 2));
measured = record(:, 3);
fit = 100 * (1 - norm(measured - y) / norm(measured - mean(measured)));
printf('FIT %.2f %%\n', fit);
